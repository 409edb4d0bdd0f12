"""Ways to look around: what there is, a paper's parameter file, what its metrics mean, LaTeX."""

from __future__ import annotations

import argparse
from pathlib import Path

from reobserve_papers.cli.options import add_output, add_project
from reobserve_papers.cli.schemas import KINDS
from reobserve_papers.cli.types import tree, whole


def list_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `list` and `metrics`."""
    command.add_argument("paper", nargs="*", help="only these papers (default: all)")
    add_project(command)


def params_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `params`."""
    command.add_argument("paper", help="a paper, as named by `reobserve-papers list`")
    command.add_argument(
        "match", nargs="?", default="", help="show only keys that contain this text"
    )
    command.add_argument("--why", action="store_true", help="show the reason for each assumption")
    command.add_argument(
        "--built",
        action="store_true",
        help="show the parameters of the last build, including overrides",
    )
    add_project(command)


def latex_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `latex`."""
    command.add_argument("source", type=Path, help="a caption (.rst) or a table (.csv)")
    command.add_argument(
        "--digits", type=whole(1, 17), metavar="N",
        help="significant digits of numbers (default: 3 for metrics; other tables as they are)",
    )  # fmt: skip
    add_output(command, "a .tex file to be included by \\input", rb"\begin{tabular}", rb"\caption[")


def new_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `new`."""
    command.add_argument("name", metavar="NAME", help="the paper: letters, digits and _")


def check_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `check`."""
    command.add_argument("paper", nargs="*", help="only these papers (default: all)")
    command.add_argument(
        "--overrides", type=tree, default={}, metavar="JSON",
        help='values to override, by paper; - reads them from standard input',
    )  # fmt: skip
    add_project(command)


def schema_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `schema`."""
    command.add_argument("kind", choices=KINDS)
