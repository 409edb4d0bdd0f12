"""The command line: reads what was typed, runs it, and reports what goes wrong in a sentence.

Sub-commands are imported when they are called: a short job pays for what it uses only.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from reobserve.cli.outputs import check_outputs
from reobserve.cli.parts import Command, CommandTable, Parser, add_commands, load
from reobserve.core.code_paths import pin_code_paths
from reobserve.core.errors import ReobserveError, one_line
from reobserve.core.extras import EXTRAS, MissingPackageError

_MOST_SAID = 10_000  # letters of a message: several claims may be broken at once

COMMANDS = CommandTable(
    "State and fault observers, and their designs, on recorded data and as C code.",
    {
        "estimate": Command(
            "run an observer on a record, or on rows as they arrive",
            "reobserve.cli.estimation:estimate", "reobserve.estimation.commands:run", "data",
        ),
        "tune": Command(
            "tune observers on recorded data, and compare them",
            "reobserve.cli.tuning:tune", "reobserve.tuning.commands:tune_records_command", "data",
        ),
        "fit": Command(
            "fit numbers of a filter to a record by maximum likelihood",
            "reobserve.cli.tuning:fit", "reobserve.tuning.fit_command:run", "data",
        ),
        "design": Command(
            "compute gains for a model, or check given ones, and certify them",
            "reobserve.cli.designs:design", "reobserve.estimation.families.design_command:run",
            "design",
        ),
        "export": Command(
            "write a design as C code",
            "reobserve.cli.designs:export", "reobserve.estimation.families.export_command:run",
            "design",
        ),
    },
    epilog="The papers and their pipeline have a command of their own, reobserve-papers.",
    other="reobserve-papers",
)  # fmt: skip


def _explain(error: Exception) -> str | None:
    return str(error) if isinstance(error, ReobserveError) else None


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one sub-command of `reobserve` (see `run_command`)."""
    return run_command("reobserve", COMMANDS, arguments)


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
        print(f"{program}: {one_line(said, _MOST_SAID)}", file=sys.stderr)
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
    program: str = "reobserve", table: CommandTable = COMMANDS, words: Sequence[str] | None = None
) -> argparse.ArgumentParser:
    """The parser of a command line.

    It has all sub-commands with their options and help, or only that of a line that ``words`` are.
    """
    parser = Parser(prog=program)
    parser.add_argument(
        "--version", action=_Version, nargs=0, default=argparse.SUPPRESS, help="show the version"
    )
    parser.add_argument(
        "--traceback", action="store_true", default=argparse.SUPPRESS,
        help="show where an error arises; at any place of the line",
    )  # fmt: skip
    add_commands(parser, table, words)
    return parser
