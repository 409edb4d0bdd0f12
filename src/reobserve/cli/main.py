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


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one sub-command of `reobserve` (see `run_command`)."""
    return run_command("reobserve", COMMANDS, arguments)


def run_command(
    program: str,
    table: CommandTable,
    arguments: Sequence[str] | None = None,
    check: Callable[[Mapping[str, Any]], None] = lambda _: None,
) -> int:
    """Run one sub-command and return its exit code: 0, 1 after a user's error, 2 for usage.

    ``check`` may refuse the options with an `InputError` before anything runs.
    """
    pin_code_paths()  # before numpy is imported
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A terminal that has no letter for a name is shown its code; lines end alike anywhere.
        sys.stdout.reconfigure(errors="backslashreplace", newline="\n")
    words = sys.argv[1:] if arguments is None else list(arguments)
    options = vars(command_parser(program, table, words).parse_args(words))
    run, extra = options.pop("run"), options.pop("extra")
    try:
        check(options)
        check_outputs(options)
        load(run)(**options)
        if sys.stdout is not None:
            sys.stdout.flush()
    except ImportError as error:  # of a package that an extra brings
        top = str(error.name).partition(".")[0]
        if top not in EXTRAS:
            raise
        purpose = getattr(error, "purpose", "run this command")
        print(f"{program}: {MissingPackageError(top, purpose, extra)}", file=sys.stderr)
        return 1
    except ReobserveError as error:
        print(f"{program}: {one_line(error, _MOST_SAID)}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        _forget_output()
    except OSError as error:  # files have their own sentences: this is standard output
        _forget_output()
        place = error.filename or "standard output"
        print(f"{program}: {place}: cannot be written ({error.strerror})", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0


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
    add_commands(parser, table, words)
    return parser
