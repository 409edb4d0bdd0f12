"""Commands: every sub-command of `reobserve` with its help, and the targets of `make`."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

from docs.generate.markdown import block, code, heading, plain, table
from reobserve.cli.main import command_parser

_WIDTH = "80"  # of a help, in letters


def commands() -> str:
    """The help of `reobserve` and of all its sub-commands."""
    with patch.dict(os.environ, COLUMNS=_WIDTH, NO_COLOR="1"):
        parser = command_parser()
        return "\n".join([block(parser.format_help(), "text"), *_below(parser, 2)])


def targets(root: Path) -> str:
    """The targets of the Makefile, with what each does."""
    makefile = (root / "Makefile").read_text(encoding="utf-8")
    rows = sorted(re.findall(r"^([a-z]+):.*?## (.+)$", makefile, re.MULTILINE))
    return table(
        ("target", "what it does"), [(code(f"make {name}"), plain(text)) for name, text in rows]
    )


def _below(parser: argparse.ArgumentParser, level: int) -> Iterator[str]:
    """The help of all sub-commands of a command, and of theirs."""
    for action in parser._actions:
        if not isinstance(action, argparse._SubParsersAction):
            continue
        for command in action.choices.values():
            name = " ".join(command.prog.split())
            anchor = re.sub(r"\W+", "-", name)
            text = block(command.format_help(), "text")
            yield f"{heading(level, code(name), anchor)}\n\n{text}"
            yield from _below(command, level + 1)
