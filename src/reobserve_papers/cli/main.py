"""The command `reobserve-papers`: the pipeline of the papers, and what it made."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from reobserve.core import command_line
from reobserve.core.command_line import Command, CommandTable, run_command
from reobserve_papers.cli.options import check_project
from reobserve_papers.cli.own_modules import explained

PROGRAM = "reobserve-papers"

# By name: what it does, its options (a module of this package), and what it calls.
_COMMANDS = {
    "list": (
        "list papers, figures, scenarios and observers",
        "overview_commands:list_options",
        "parameters.overview:show_list",
    ),
    "params": (
        "show a paper's parameter file: values, sources, ranges",
        "overview_commands:params_options",
        "parameters.overview:show_params",
    ),
    "new": (
        "write a repository for a paper of your own into a folder NAME",
        "overview_commands:new_options",
        "cli.new_repository:new_command",
    ),
    "check": (
        "check everything under config/; this runs code of the papers",
        "overview_commands:check_options",
        "cli.stages.check:run",
    ),
    "stage": ("run one stage of the pipeline by hand", "stage_commands:STAGES", ""),
    "report": (
        "write the replication report of the results",
        "evidence_commands:report_options",
        "report.render:report_command",
    ),
    "samples": (
        "compute more samples where claims are undecided",
        "evidence_commands:samples_options",
        "claims.sample_command:sample_command",
    ),
    "figdiff": (
        "compare figures, numbers and verdicts with the accepted ones",
        "evidence_commands:figdiff_options",
        "figure_diff.figdiff_commands:figdiff_command",
    ),
    "accept": (
        "build, and accept figures, numbers and verdicts",
        "evidence_commands:accept_options",
        "figure_diff.figdiff_commands:accept_command",
    ),
    "latex": (
        "write a caption or a table of the results as LaTeX",
        "overview_commands:latex_options",
        "cli.stages.latex:run",
    ),
    "metrics": (
        "print what the metrics of papers are",
        "overview_commands:list_options",
        "steps.glossary:print_metrics",
    ),
    "schema": (
        "print the JSON schema of a configuration file",
        "overview_commands:schema_options",
        "cli.schemas:print_schema",
    ),
    "bench": ("compare observers and filters that are tuned by one rule", "bench:BENCH", ""),
}

COMMANDS = CommandTable(
    "Papers on observers: parameters, jobs, evidence. On recorded data: reobserve.",
    {
        name: Command(
            text, f"reobserve_papers.cli.{options}", run and f"reobserve_papers.{run}", "papers"
        )
        for name, (text, options, run) in _COMMANDS.items()
    },
    other="reobserve",
)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one sub-command of `reobserve-papers` (see `run_command`)."""
    return run_command(PROGRAM, COMMANDS, arguments, check_project, explained)


def command_parser() -> argparse.ArgumentParser:
    """The parser of all sub-commands."""
    return command_line.command_parser(PROGRAM, COMMANDS)
