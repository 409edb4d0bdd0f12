"""Markdown: text that is shown as it stands, code, tables, pages."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

# All that is markup within a line or at its start; as entities they are none, in tables as well.
_MARKUP = re.compile(r"[\\*\[\]{}<|$`~]|(?<!\w)_|_(?!\w)|&(?=#?\w+;)|^[#>+-]")


@dataclass(frozen=True)
class Page:
    """A page: where it is in the folder of all, its entry in the navigation, and what it says."""

    path: str
    title: str
    text: str


def heading(level: int, text: str, anchor: str) -> str:
    """A heading that links lead to by ``anchor``, on the site and on a code host."""
    return f'{"#" * level} <a id="{anchor}"></a>{text}'


def plain(text: object) -> str:
    """Text on one line that is shown as it is, whatever it would mean as markup."""
    line = re.sub(r"\s+", " ", str(text))
    return _MARKUP.sub(lambda found: f"&#{ord(found[0])};", line)


def code(text: object) -> str:
    """The same as code."""
    line = re.sub(r"\s+", " ", str(text))
    return f"<code>{plain(line)}</code>" if re.search("[`|]|^ ?$", line) else f"`{line}`"


def ticks(text: object) -> str:
    """Text in which what stands between backticks is code."""
    pieces = re.split(r"`+([^`]+)`+", str(text))
    return "".join(code(piece) if k % 2 else plain(piece) for k, piece in enumerate(pieces))


def table(header: Sequence[str], rows: Iterable[Sequence[str]], aligned: str = "") -> str:
    """A table of cells that are Markdown; ``aligned`` has an `r` for each column of numbers."""
    marks = [("---:" if mark == "r" else "---") for mark in aligned.ljust(len(header), "l")]
    lines = [header, marks, *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def block(text: str, language: str = "", title: str = "") -> str:
    """A block of code."""
    named = f' title="{title}"' if title else ""
    fence = "`" * max(3, *(len(run) + 1 for run in re.findall("`+", text)), 3)
    return f"{fence}{language}{named}\n{text.rstrip()}\n{fence}\n"
