"""The command `reobserve`: observers on recorded data, their designs, and C code."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from reobserve.core import command_line
from reobserve.core.command_line import Command, CommandTable, run_command

PROGRAM = "reobserve"

COMMANDS = CommandTable(
    "State and fault observers, and their designs, on recorded data and as C code.",
    {
        "estimate": Command(
            "run an observer on a record, or on rows as they arrive",
            "reobserve.cli.estimation:estimate", "reobserve.estimation.estimate_command:run",
            "data",
        ),
        "tune": Command(
            "tune observers on recorded data, and compare them",
            "reobserve.cli.tuning:tune", "reobserve.tuning.tune_command:run", "data",
        ),
        "fit": Command(
            "fit numbers of a filter to a record by maximum likelihood",
            "reobserve.cli.tuning:fit", "reobserve.tuning.fit_command:run", "data",
        ),
        "design": Command(
            "compute gains for a model, or check given ones, and certify them",
            "reobserve.cli.designs:design", "reobserve.estimation.design_command:run", "design",
        ),
        "export": Command(
            "write a design as C code",
            "reobserve.cli.designs:export", "reobserve.estimation.export_command:run", "design",
        ),
    },
    epilog="The papers and their pipeline have a command of their own, reobserve-papers.",
    other="reobserve-papers",
)  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one sub-command of `reobserve` (see `run_command`)."""
    return run_command(PROGRAM, COMMANDS, arguments)


def command_parser() -> argparse.ArgumentParser:
    """The parser of all sub-commands."""
    return command_line.command_parser(PROGRAM, COMMANDS)
