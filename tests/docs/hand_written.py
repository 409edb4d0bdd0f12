"""The pages of the documentation, as text: their blocks, code for cog, and links."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from docs.outputs import PAGES, ROOT

__all__ = ["PAGES", "ROOT"]

_FENCE = re.compile(r"^(?P<fence>`{3,})(?P<head>[^\n`]*)\n(?P<body>.*?)^(?P=fence)$", re.M | re.S)
_SNIPPET = re.compile(r"^<!-- \[\[\[cog\b(.*?)\]\]\] -->$", re.M | re.S)


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, its options, its text, the line on which that begins."""

    language: str
    options: str
    text: str
    line: int


def hand_written() -> list[Path]:
    """Those in the three folders that teach."""
    return sorted(
        page
        for folder in ("tutorials", "how-to", "explanation")
        for page in (PAGES / folder).glob("*.md")
    )


def name(page: Path) -> str:
    """The page as it is called in links from the root of the site."""
    return page.relative_to(PAGES).as_posix()


def blocks(page: Path) -> Iterator[Block]:
    """The fenced blocks in order, those that code has printed among them."""
    text = _SNIPPET.sub(lambda found: "\n" * found[0].count("\n"), page.read_text(encoding="utf-8"))
    for found in _FENCE.finditer(text):
        language, _, options = found["head"].strip().partition(" ")
        yield Block(language, options, found["body"], text[: found.start("body")].count("\n") + 1)


def snippets(page: Path) -> list[str]:
    """The code for cog."""
    return [found.strip() for found in _SNIPPET.findall(page.read_text(encoding="utf-8"))]


def prose(page: Path) -> str:
    """The text without its fenced blocks and without code for cog."""
    return _FENCE.sub("", _SNIPPET.sub("", page.read_text(encoding="utf-8")))
