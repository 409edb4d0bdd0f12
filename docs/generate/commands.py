"""Commands: every sub-command of both programs with its help, and the targets of `make`."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

from docs.generate.markdown import block, code, heading, plain, table
from reobserve.cli import main as library
from reobserve_papers.cli import main as papers

_WIDTH = "80"  # of a help, in letters


def commands() -> str:
    """The help of `reobserve`, of `reobserve-papers` and of all their sub-commands."""
    with patch.dict(os.environ, COLUMNS=_WIDTH, NO_COLOR="1"):
        parsers = (library.command_parser(), papers.command_parser())
        return "\n".join(text for parser in parsers for text in _of(parser, 2))


def targets(root: Path) -> str:
    """The targets of the Makefile, with what each does."""
    makefile = (root / "Makefile").read_text(encoding="utf-8")
    rows = sorted(re.findall(r"^([a-z]+):.*?## (.+)$", makefile, re.MULTILINE))
    return table(("target", "effect"), [(code(f"make {name}"), plain(text)) for name, text in rows])


def _of(parser: argparse.ArgumentParser, level: int) -> Iterator[str]:
    """The help of a command, and of all its sub-commands."""
    name = " ".join(parser.prog.split())
    anchor = re.sub(r"\W+", "-", name)
    yield f"{heading(level, code(name), anchor)}\n\n{block(parser.format_help(), 'text')}"
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _of(command, level + 1)
