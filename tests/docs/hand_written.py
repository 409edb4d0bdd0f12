"""The hand-written pages of the documentation, as text: their blocks, references and links."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = ROOT / "docs" / "pages"

# What is built or written elsewhere: pages that hand-written ones may link to.
GENERATED = (
    re.compile(r"findings/(delay|eso|ilo|imm|lie)\.md"),
    re.compile(r"reference/parameters/(delay|eso|ilo|imm|lie)\.md"),
    re.compile(r"reference/(commands|index|configuration)\.md"),
    re.compile(r"(gallery|equations|index)\.md"),
    re.compile(r"(gallery|start|project)/\w+\.md"),
)

_FENCE = re.compile(r"^(?P<fence>`{3,})(?P<head>[^\n`]*)\n(?P<body>.*?)^(?P=fence)$", re.M | re.S)


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, its options, its text, the line on which that begins."""

    language: str
    options: str
    text: str
    line: int

    @property
    def executed(self) -> bool:
        """Whether the build runs it."""
        return 'exec="1"' in self.options


def hand_written() -> list[Path]:
    """Those in the three folders, without any that a build has written beside them."""
    return sorted(
        page
        for folder in ("tutorials", "how-to", "explanation")
        for page in (PAGES / folder).glob("*.md")
    )


def name(page: Path) -> str:
    """The page as it is called in links from the root of the site."""
    return page.relative_to(PAGES).as_posix()


def blocks(page: Path) -> Iterator[Block]:
    """The fenced blocks in order."""
    text = page.read_text(encoding="utf-8")
    for found in _FENCE.finditer(text):
        language, _, options = found["head"].strip().partition(" ")
        yield Block(language, options, found["body"], text[: found.start("body")].count("\n") + 1)


def prose(page: Path) -> str:
    """The text without its fenced blocks."""
    return _FENCE.sub("", page.read_text(encoding="utf-8"))


def everything(page: Path) -> str:
    """Prose, and what blocks that are run may print: links and references may stand in both."""
    run = [block.text for block in blocks(page) if block.executed]
    return "\n".join([prose(page), *run])
