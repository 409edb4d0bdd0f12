"""Where is equation (9)? For each paper its equations and the code that cites them.

Docstrings and comments cite in one form, the name of the paper, a comma and places in it:

    Chen & Saif 2007, (1), after (1), (5) to (7) and Remarks 3 to 5

Docstrings of modules are left out: they introduce the functions and classes that cite. That of
the paper's package begins with the name and a colon. It has a list of the places that no code
computes, each with the reason: `- (8) to (10): a step of the proof`.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from docs.generate.api import is_shown
from docs.generate.evidence import Paper
from docs.generate.markdown import code, heading, plain, table, ticks

KINDS = "Assumption|Definition|Lemma|Proposition|Remark|Table|Theorem"
_PLACE = re.compile(
    rf"(?:(after|before|(?:{KINDS})s?) )?(\(\d+\)|\d+(?:\.\d+)?|[IVX]+\b)(?: to (\(\d+\)|\d+))?"
    r"|(?:Section \w+|Appendix), [A-Za-z]+(?:\(z\))?"
)
_AND = re.compile(", | and ")
_COMMENT = re.compile(r"(?:^[ \t]*#.*\n)+", re.MULTILINE)
_ITEM = re.compile(r"^- (.+(?:\n  .+)*)", re.MULTILINE)


@dataclass(frozen=True)
class Citations:
    """How a paper is cited; by place what code cites it, or the reason why none computes it."""

    name: str
    code: dict[str, list[str]]
    reasons: dict[str, str]


def equations(papers: Iterable[Paper]) -> str:
    """A table for each paper whose package has the name by which it is cited."""
    parts = []
    for paper in papers:
        if (found := citations(paper.root, paper.parameters.package)) is None:
            continue
        title = f"[*{plain(paper.about['title'])}*](../findings/{paper.name}.md)"
        cited = f"{title}, cited in the code as {code(found.name)}."
        ordered = sorted({*found.code, *found.reasons}, key=_order)
        rows = table(("equation", "where"), [_row(paper, one, found) for one in ordered])
        parts.append(f"{heading(2, code(paper.name), paper.name)}\n\n{cited}\n\n{rows}")
    return "\n".join(parts)


def anchor(paper: str, place: str) -> str:
    """Where an equation is on the page."""
    return "-".join([paper, *re.findall(r"\w+", place.lower())])


def citations(root: Path, package: str) -> Citations | None:
    """The citations in a project of the paper that a package names; None if it names none."""
    file = root / "src" / package.replace(".", "/") / "__init__.py"
    text = file.read_text(encoding="utf-8") if file.is_file() else ""
    about = ast.get_docstring(ast.parse(text)) or ""
    name, colon, _ = about.partition(":")
    if not colon:
        return None
    items = [_joined(item).partition(": ") for item in _ITEM.findall(about)]
    reasons = {place: reason for listed, _, reason in items for place in places(listed)}
    found: dict[str, list[str]] = {}
    for owner, text in texts(root):
        for cited in text.split(f"{name}, ")[1:]:
            for place in places(cited):
                found.setdefault(place, []).append(owner)
    return Citations(name, {place: list(dict.fromkeys(found[place])) for place in found}, reasons)


def places(text: str) -> list[str]:
    """The places with which a text begins, `(1) to (3), Lemma 4`, each by itself."""
    found: list[str] = []
    several, at = "", 0
    while match := _PLACE.match(text, at):
        word, first, last = (group or "" for group in match.groups())
        counted = first[:1] not in "(" and not word  # as 2 in `Remarks 1 and 2`
        if counted and not several:
            break
        kind = several if counted else word.removesuffix("s")
        several = kind if counted or word.endswith("s") else ""
        numbers = [first]
        if last:
            begin, end = (int(number.strip("()")) for number in (first, last))
            numbers = [first.replace(str(begin), str(k)) for k in range(begin, end + 1)]
        found += [f"{kind} {number}".strip() or match[0] for number in numbers]
        if not (separator := _AND.match(text, match.end())):
            break
        at = separator.end()
    return found


@cache
def texts(root: Path) -> list[tuple[str, str]]:
    """Docstrings and comments below `src`, each with the module, class or function it is in."""
    found = []
    for file in sorted((root / "src").rglob("*.py")):
        text = file.read_text(encoding="utf-8")
        parts = file.relative_to(root / "src").with_suffix("").parts
        module = ".".join(parts).removesuffix(".__init__")
        scopes = list(_scopes(ast.parse(text), module))
        found += [(owner, _joined(docstring)) for owner, docstring, _ in scopes]
        for comment in _COMMENT.finditer(text):
            line = text.count("\n", 0, comment.start()) + 1
            inside = [owner for owner, _, lines in scopes if line in lines]
            found.append(([module, *inside][-1], _joined(comment[0].replace("#", " "))))
    return found


def _scopes(node: ast.Module | ast.ClassDef, name: str) -> Iterator[tuple[str, str, range]]:
    """Classes and functions, outer ones first, each with its docstring and lines."""
    for child in node.body:
        if isinstance(child, ast.ClassDef | ast.FunctionDef):
            owner, lines = f"{name}.{child.name}", range(child.lineno, (child.end_lineno or 0) + 1)
            yield owner, ast.get_docstring(child) or "", lines
            if isinstance(child, ast.ClassDef):
                yield from _scopes(child, owner)


def _joined(text: str) -> str:
    return " ".join(text.split())


def _order(place: str) -> tuple[bool, str]:
    """Equations first, `before (9)` before and `after (9)` after `(9)`; numbers by their size."""
    padded = re.sub(r"\d+", lambda digits: digits[0].zfill(4), place)
    numbered = re.fullmatch(r"(before |after |)\((\d+)\)", padded)
    if numbered is None:
        return True, padded
    return False, numbered[2] + {"before ": "0", "": "1", "after ": "2"}[numbered[1]]


def _row(paper: Paper, place: str, found: Citations) -> tuple[str, str]:
    where = [
        f"[{code(name)}][{name}]" if "._" not in name and is_shown(paper.root, name) else code(name)
        for name in found.code.get(place, ())
    ]
    if place in found.reasons:
        where.append(f"*none*: {ticks(found.reasons[place])}")
    return f'<a id="{anchor(paper.name, place)}"></a>{plain(place)}', "<br>".join(where)
