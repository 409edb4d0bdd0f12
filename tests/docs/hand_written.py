"""The documentation pages as text: blocks, cog code and links."""

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
    """A fenced block: language, options, text and its first line."""

    language: str
    options: str
    text: str
    line: int


def hand_written() -> list[Path]:
    """The pages in the three folders of tutorials and guides."""
    return sorted(
        page
        for folder in ("tutorials", "how-to", "explanation")
        for page in (PAGES / folder).glob("*.md")
    )


def name(page: Path) -> str:
    """The name of the page in links from the root of the site."""
    return page.relative_to(PAGES).as_posix()


def blocks(page: Path) -> Iterator[Block]:
    """The fenced blocks in order, including those printed by code."""
    text = _SNIPPET.sub(lambda found: "\n" * found[0].count("\n"), page.read_text(encoding="utf-8"))
    for found in _FENCE.finditer(text):
        language, _, options = found["head"].strip().partition(" ")
        yield Block(language, options, found["body"], text[: found.start("body")].count("\n") + 1)


def snippets(page: Path) -> list[str]:
    """The cog code."""
    return [found.strip() for found in _SNIPPET.findall(page.read_text(encoding="utf-8"))]


def prose(page: Path) -> str:
    """The text without fenced blocks and cog code."""
    return _FENCE.sub("", _SNIPPET.sub("", page.read_text(encoding="utf-8")))
