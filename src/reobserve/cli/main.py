"""The command line: reads what was typed, runs it, and tells what goes wrong in a sentence.

Sub-commands are imported when they are called: a short job pays for what it uses only.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import os
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import NoReturn

from reobserve_papers.cli.bench import add_bench, add_tune
from reobserve.cli.designs import add_designs
from reobserve.cli.estimation import add_estimate
from reobserve_papers.cli.evidence import add_evidence
from reobserve.cli.outputs import check_outputs
from reobserve_papers.cli.overview import add_overview
from reobserve_papers.cli.stage_commands import add_stages
from reobserve.core.code_paths import pin_code_paths
from reobserve.core.errors import InputError, ReobserveError, one_line, shown
from reobserve.core.extras import EXTRAS, missing

# The extra of pyproject.toml that the commands of a package take, if not `pipeline`.
_EXTRAS = {"estimation.commands": "data", "estimation.families": "design", "codegen": "design"}

_MOST_SAID = 10_000  # letters of a message: several claims may be broken at once


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one sub-command; the exit code is 0, 1 after an error of the user's, 2 for usage."""
    pin_code_paths()  # before numpy is imported
    if isinstance(sys.stdout, io.TextIOWrapper):
        # A terminal that has no letter for a name is shown its code; lines end alike anywhere.
        sys.stdout.reconfigure(errors="backslashreplace", newline="\n")
    options = vars(command_parser().parse_args(arguments))
    module, function = options.pop("run").split(":")
    extra = next((one for part, one in _EXTRAS.items() if module.startswith(part)), "pipeline")
    try:
        if "project" in options:
            _check_project(options["project"])
        check_outputs(options)
        getattr(importlib.import_module(f"reobserve.{module}"), function)(**options)
        if sys.stdout is not None:
            sys.stdout.flush()
    except ReobserveError as error:
        print(f"reobserve: {one_line(error, _MOST_SAID)}", file=sys.stderr)
        return 1
    except ModuleNotFoundError as error:  # what is imported late, with no sentence of its own
        top = str(error.name).partition(".")[0]
        if top not in EXTRAS:
            raise
        print(f"reobserve: {missing(top, 'run this command', extra)}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        _forget_output()
    except OSError as error:  # files have their own sentences: this is standard output
        _forget_output()
        place = error.filename or "standard output"
        print(f"reobserve: {place}: cannot be written ({error.strerror})", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    return 0


def _check_project(folder: Path) -> None:
    if not (folder / "config" / "papers").is_dir():
        where = "this folder" if folder == Path() else shown(str(folder))
        problem = f"{where} has no config/papers; name a checkout of reobserve, or run this in one"
        raise InputError("--project", problem)


def _forget_output() -> None:
    """Let what standard output did not take go nowhere when the interpreter flushes it at exit."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class _Parser(argparse.ArgumentParser):
    """Says what is wrong with an argument on one line, however long the argument is."""

    def error(self, message: str) -> NoReturn:
        super().error(one_line(message))


class _Version(argparse.Action):
    """Looks the version up when it is asked for: that takes as long as a short job."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object, **__: object) -> None:
        from importlib import metadata

        print("reobserve", metadata.version("reobserve"))
        parser.exit()


@cache
def command_parser() -> argparse.ArgumentParser:
    """What reads a command line: all sub-commands, their options and help."""
    parser = _Parser(
        prog="reobserve",
        description="State and fault observers from five papers.",
    )
    parser.add_argument(
        "--version", action=_Version, nargs=0, default=argparse.SUPPRESS, help="show the version"
    )
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    add_designs(commands)
    add_overview(commands)
    add_estimate(commands)
    add_evidence(commands)
    add_tune(commands)
    add_bench(commands)
    add_stages(commands)
    return parser
