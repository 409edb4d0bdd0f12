"""Commands on the evidence: report, Monte Carlo samples, figure comparison."""

from __future__ import annotations

import argparse
from pathlib import Path

from reobserve_papers.cli.options import FORMATS, add_output, add_project
from reobserve_papers.cli.types import whole


def samples_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `samples`."""
    command.add_argument("paper", nargs="*", help="only these papers (default: all)")
    command.add_argument(
        "--max-samples",
        type=whole(1, 1_000_000),
        help="maximum number of samples per claim (default: the convention, or the claim's own)",
    )
    command.add_argument(
        "--claim", nargs="+", default=[], metavar="NAME", help="only these claims (default: all)"
    )
    command.add_argument(
        "--check", action="store_true", help="repeat the cached samples and compare; write nothing"
    )
    add_project(command)


def report_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `report`."""
    default = "(default: those of the config)"
    command.add_argument("--papers", nargs="+", help=f"papers to report {default}")
    command.add_argument(
        "--formats",
        nargs="+",
        choices=FORMATS,
        metavar="FORMAT",
        help=f"formats of the figures {default}",
    )
    command.add_argument(
        "--bench", nargs="*", help=f"tasks of the bench to report where they were built {default}"
    )
    command.add_argument(
        "--fresh", action="store_true",
        help="do not ask Snakemake what is up to date: all is",
    )  # fmt: skip
    add_output(command, "the page, HTML", b"<!doctype html>")
    add_project(command)


def figdiff_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `figdiff`."""
    command.add_argument(
        "part",
        nargs="*",
        metavar="PAPER[/FIGURE]",
        help="only these papers, or figures, tables or theories of papers (default: all)",
    )
    _folders(command, ("output", "figdiff", "the folder for the page and its summary"))
    command.add_argument(
        "--cores", type=whole(1), default=0, help="build first, with so many processor cores"
    )
    add_project(command)


def accept_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `accept`."""
    command.add_argument(
        "--reason", required=True, help="why they changed; written into tests/golden/REASONS.md"
    )
    command.add_argument(
        "paper", nargs="*", metavar="PAPER[/FIGURE]",
        help="only these papers, or figures, tables or theories of papers (default: all)",
    )  # fmt: skip
    command.add_argument(
        "--cores", type=whole(1), default=2, help="processor cores for the build (default: 2)"
    )
    _folders(command)
    add_project(command)


def _folders(command: argparse.ArgumentParser, *others: tuple[str, str, str]) -> None:
    folders = (
        ("reference", "tests/reference", "the accepted figures, or files of any script"),
        ("results", "results", "the folder of results"),
    )
    for name, default, text in (*folders, *others):
        command.add_argument(
            f"--{name}", type=Path, default=Path(default), metavar="DIR",
            help=f"{text} (default: {default})",
        )  # fmt: skip
    command.add_argument(
        "--tolerances", type=Path, metavar="FILE",
        help="for folders of other files: relative, absolute, picture, and files with their own",
    )  # fmt: skip
