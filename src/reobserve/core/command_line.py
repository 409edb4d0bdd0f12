"""The command line: reads what was typed, runs it, and reports what goes wrong in a sentence.

Sub-commands stand in tables. Only the one that is typed is built, and imported when it is called:
a short job pays for what it uses only.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import importlib
import io
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

from reobserve.core.code_paths import pin_code_paths
from reobserve.core.errors import ReobserveError, nearest, one_line, shown
from reobserve.core.extras import EXTRAS, MissingPackageError
from reobserve.core.outputs import check_outputs

_MANY = 300_000  # objects, some tens of megabytes
_MOST_SAID = 10_000  # letters of a message: several claims may be broken at once


@dataclass(frozen=True)
class Command:
    """A sub-command of a table.

    Attributes
    ----------
    text
        What it does, in one line.
    options
        What adds its options to a parser: a function, or ``"module:name"`` of one, or of a
        `CommandTable`.
    run
        ``"module:function"`` that it calls with its options by name; empty for a table.
    extra
        The extra of the distribution that it needs.
    """

    text: str
    options: str | Callable[[argparse.ArgumentParser], None]
    run: str = ""
    extra: str = ""


@dataclass(frozen=True)
class CommandTable:
    """Sub-commands by name, an epilog for the help that lists them, a program that has others."""

    text: str
    commands: Mapping[str, Command]
    title: str = "commands"
    epilog: str = ""
    other: str = ""


class _Parser(argparse.ArgumentParser):
    """A parser that takes options anywhere, and whose errors are one line."""

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse a line, of a command with options between its arguments."""
        if self._subparsers is not None or self._inner:
            return super().parse_known_args(args, namespace)
        self._inner = True  # it calls this function for options, and again for the rest
        try:
            return self.parse_known_intermixed_args(args, namespace)
        finally:
            self._inner = False

    _inner = False

    def error(self, message: str) -> NoReturn:
        """Print the usage and what is wrong, and exit with 2."""
        super().error(one_line(message))


def load(place: str) -> Any:
    """The object that ``"module:name"`` names."""
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(module), name)


def _add_commands(
    parser: argparse.ArgumentParser, table: CommandTable, words: Sequence[str] | None
) -> None:
    """Add the sub-commands of a table to a parser.

    Of the sub-commands, only the one that ``words`` begin with gets its options; if they begin with
    none, all are listed for the help. None builds all of them.
    """
    parser.description, parser.epilog = table.text, table.epilog
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    metavar = table.title.removesuffix("s").upper()
    group = parser.add_subparsers(title=table.title, metavar=metavar, required=True)
    typed = words[0] if words and words[0] in table.commands else None
    if words and typed is None and not words[0].startswith("-"):
        more = f"; {table.other} has others" if table.other else ""
        known, near = ", ".join(table.commands), nearest(words[0], table.commands)
        near = near if "did you mean" in near else ""
        problem = f"there is no {shown(words[0])}, only {known}{near}{more}"
        parser.error(f"argument {metavar}: {problem}")
    for name, entry in table.commands.items():
        if typed is not None and name != typed:
            continue
        text = entry.text[0].upper() + entry.text[1:] + "."
        command = group.add_parser(name, help=entry.text, description=text)
        if typed is None and words is not None:
            continue
        options = load(entry.options) if isinstance(entry.options, str) else entry.options
        if isinstance(options, CommandTable):
            _add_commands(command, options, None if words is None else words[1:])
        else:
            options(command)
            if command.epilog:
                command.formatter_class = argparse.RawDescriptionHelpFormatter
            command.set_defaults(run=entry.run, extra=entry.extra)


def _explain(error: Exception) -> str | None:
    return str(error) if isinstance(error, ReobserveError) else None


def run_command(
    program: str,
    table: CommandTable,
    arguments: Sequence[str] | None = None,
    check: Callable[[Mapping[str, Any]], None] = lambda _: None,
    explain: Callable[[Exception], str | None] = _explain,
) -> int:
    """Run one sub-command and return its exit code: 0, 1 after a user's error, 2 for usage.

    ``check`` may refuse the options with an `InputError` before anything runs. ``explain`` has the
    sentence on an error, or None if it needs its traceback, which `--traceback` always shows.
    """
    pin_code_paths()  # before numpy is imported
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A terminal that has no letter for a name is shown its code; lines end alike anywhere.
        sys.stdout.reconfigure(errors="backslashreplace", newline="\n")
    words = sys.argv[1:] if arguments is None else list(arguments)
    traced = "--traceback" in words
    words = [word for word in words if word != "--traceback"]
    options = vars(command_parser(program, table, words).parse_args(words))
    run, extra = options.pop("run"), options.pop("extra")
    try:
        check(options)
        check_outputs(options)
        load(run)(**options)
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        _forget_output()
    except KeyboardInterrupt:
        return 130
    except Exception as error:
        if traced:
            raise
        said = _missing_package(error, extra) or explain(error)
        if said is None and isinstance(error, OSError):  # files have their own sentences
            _forget_output()
            place = error.filename or "standard output"
            said = f"{place}: cannot be written ({error.strerror})"
        if said is None:
            raise
        problems = getattr(error, "problems", [error])
        for problem in problems:
            sentence = said if problem is error else str(problem)
            print(f"{program}: {one_line(sentence, _MOST_SAID)}", file=sys.stderr)
            for note in getattr(problem, "__notes__", ()):
                print(f"  {one_line(note)}", file=sys.stderr)
        return 1
    return 0


def _missing_package(error: Exception, extra: str) -> str | None:
    """The sentence on a package that is not installed, if an extra brings it."""
    top = str(error.name).partition(".")[0] if isinstance(error, ImportError) else ""
    if top not in EXTRAS:
        return None
    return str(MissingPackageError(top, getattr(error, "purpose", "run this command"), extra))


def _forget_output() -> None:
    """Let what standard output did not take go nowhere when the interpreter flushes it at exit."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _Version(argparse.Action):
    """Looks the version up when it is asked for: that takes as long as a short job."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object, **__: object) -> None:
        from importlib import metadata

        print(parser.prog, metadata.version("reobserve"))
        parser.exit()


def command_parser(
    program: str, table: CommandTable, words: Sequence[str] | None = None
) -> argparse.ArgumentParser:
    """The parser of a command line.

    It has all sub-commands with their options and help, or only that of a line that ``words`` are.
    """
    parser = _Parser(prog=program)
    parser.add_argument(
        "--version", action=_Version, nargs=0, default=argparse.SUPPRESS, help="show the version"
    )
    parser.add_argument(
        "--traceback", action="store_true", default=argparse.SUPPRESS,
        help="show where an error arises; at any place of the line",
    )  # fmt: skip
    _add_commands(parser, table, words)
    return parser


def leave(main: Callable[[], int]) -> NoReturn:
    """Run a command line and leave at once, with all files written.

    To take apart an interpreter that holds compiled loops takes longer than most jobs compute.
    Plots go to files, whatever a notebook has set for the windows of its own process. Plugins of
    pydantic, which it would look for among all packages, have no part in this.
    """
    collect_rarely()
    os.environ["MPLBACKEND"] = "agg"
    os.environ["PYDANTIC_DISABLE_PLUGINS"] = "__all__"
    code = main()
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    os._exit(code)


def collect_rarely() -> None:
    """Look for cycles only among more objects than a short process makes.

    Those that imports make live as long as the process; to search them again and again takes a
    fifth of a short job. A long one is searched, so that its memory stays bounded.
    """
    gc.set_threshold(_MANY)
