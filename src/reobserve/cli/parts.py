"""Helpers for sub-commands: adding one, and arguments that many take."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

FORMATS = ("pdf", "svg", "png", "eps", "pgf")  # of figures


def add_command(commands: Any, name: str, run: str, text: str) -> argparse.ArgumentParser:
    """A sub-command that calls ``run``, as ``"module:function"`` below `reobserve`."""
    command: argparse.ArgumentParser = commands.add_parser(
        name, help=text, description=text[0].upper() + text[1:] + "."
    )
    command.set_defaults(run=run)
    return command


def add_project(command: argparse.ArgumentParser) -> None:
    """Let it be called from another folder than the project's."""
    command.add_argument(
        "--project", type=Path, default=Path(), metavar="DIR",
        help="the project folder, with config and workflow (default: the current one)",
    )  # fmt: skip


def add_output(command: argparse.ArgumentParser, text: str) -> None:
    """Ask for the one file that it writes."""
    command.add_argument("--output", type=Path, required=True, metavar="FILE", help=text)
