"""Citations of a paper in texts: numbers in parentheses, theorems, remarks, tables."""

from __future__ import annotations

import re
from collections.abc import Iterator

_KINDS = "Assumption|Definition|Lemma|Proposition|Remark|Table|Theorem"
_MARK = r"(?:\d+(?:\.\d+)?|[IVX]+\b)"
_AND = "(?:, | and | to )"

_NUMBERS = re.compile(r"(?<![^\s(])\((\d\d?)\)(?: to \((\d+)\))?")
_ONE = re.compile(rf"\b({_KINDS}) ({_MARK})")
_SEVERAL = re.compile(rf"\b({_KINDS})s ({_MARK}(?:{_AND}{_MARK})*)")

# After the name of a paper: the longest list of citations.
_BESIDE = re.compile(r"(?:after|before) \(\d+\)|Section \w+, [A-Za-z]+(?:\(z\))?")
_PLACE = rf"(?:{_BESIDE.pattern}|\(\d+\)|{_SEVERAL.pattern}|{_ONE.pattern})"
_PLACES = re.compile(rf"{_PLACE}(?:{_AND}{_PLACE})*")


def places_in(text: str) -> list[str]:
    """All citations in a text without the name of a paper, named like table entries."""
    found: list[str] = []
    text = " ".join(text.split())
    for first, last in _NUMBERS.findall(text):
        found += (f"({k})" for k in range(int(first), int(last or first) + 1))
    found += (" ".join(one) for one in _ONE.findall(text))
    for kind, marks in _SEVERAL.findall(text):
        found += (f"{kind} {mark}" for mark in _marks(marks))
    return list(dict.fromkeys(found))


def cited(text: str, name: str) -> list[str]:
    """All citations of the named paper, in the form: the name, a comma, places."""
    found: list[str] = []
    text = " ".join(text.split())
    for match in re.finditer(re.escape(f"{name}, "), text):
        if places := _PLACES.match(text, match.end()):
            found += _BESIDE.findall(places[0])
            found += places_in(_BESIDE.sub("", places[0]))
    return list(dict.fromkeys(found))


def _marks(text: str) -> Iterator[str]:
    """Expand `1 to 4 and 7` to 1, 2, 3, 4 and 7."""
    for part in re.split(" and |, ", text):
        first, _, last = part.partition(" to ")
        if last:
            yield from map(str, range(int(first), int(last) + 1))
        else:
            yield first
