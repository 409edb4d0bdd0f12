"""Options that many commands take."""

from __future__ import annotations

import argparse
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError, nearest, shown

_READ = ("task_file", "source", "tuned", "cached", "again", "table")  # files and folders to read
FORMATS = ("pdf", "svg", "png", "eps", "pgf")  # of figures


def add_output(command: argparse.ArgumentParser, text: str, *begins: bytes) -> None:
    """Ask for the one file that it writes, and that begins with one of these."""
    command.add_argument("--output", type=Path, required=True, metavar="FILE", help=text)
    command.set_defaults(begins=begins)


def add_project(command: argparse.ArgumentParser) -> None:
    """Let it be called from another folder than the project's."""
    command.add_argument(
        "--project", type=Path, default=Path(), metavar="DIR",
        help="the project folder, with config and workflow (default: the current one)",
    )  # fmt: skip


def check_project(options: Mapping[str, Any]) -> None:
    """Refuse the folder of ``--project`` if it is no project, and misspelt names of files.

    Two folders to compare need no project.
    """
    for path in (options[key] for key in _READ if isinstance(options.get(key), Path)):
        missing = [one for one in (path, *path.parents) if not os.path.lexists(one)]
        if missing and missing[-1].parent.is_dir():
            near = nearest(missing[-1].name, os.listdir(missing[-1].parent))
            if near.startswith("; did"):
                raise InputError(str(path), f"there is no {shown(missing[-1].name)}{near}")
    folder = None if "reference" in options else options.get("project")
    if folder is not None and not (folder / "config" / "papers").is_dir():
        where = "this folder" if folder == Path() else shown(str(folder))
        problem = (
            f"{where} has no config/papers; name a checkout of reobserve, run this in one, or "
            "begin a paper of your own: reobserve-papers new NAME"
        )
        raise InputError("--project", problem)
