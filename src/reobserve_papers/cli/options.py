"""Options that many commands take."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError, shown

FORMATS = ("pdf", "svg", "png", "eps", "pgf")  # of figures


def add_output(command: argparse.ArgumentParser, text: str) -> None:
    """Ask for the one file that it writes."""
    command.add_argument("--output", type=Path, required=True, metavar="FILE", help=text)


def add_project(command: argparse.ArgumentParser) -> None:
    """Let it be called from another folder than the project's."""
    command.add_argument(
        "--project", type=Path, default=Path(), metavar="DIR",
        help="the project folder, with config and workflow (default: the current one)",
    )  # fmt: skip


def check_project(options: Mapping[str, Any]) -> None:
    """Refuse the folder of ``--project`` if it is no project, but for two folders to compare."""
    folder = None if "reference" in options else options.get("project")
    if folder is not None and not (folder / "config" / "papers").is_dir():
        where = "this folder" if folder == Path() else shown(str(folder))
        problem = f"{where} has no config/papers; name a checkout of reobserve, or run this in one"
        raise InputError("--project", problem)
