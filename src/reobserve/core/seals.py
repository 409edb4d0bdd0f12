"""Digests inside files that one step hands to the next: what has changed since is refused.

A table has its digest in the name of a last, empty column, a JSON file under the key ``sha256``.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from typing import Any

from reobserve.core.errors import InputError

_MARK = "sha256:"
_KEY = "sha256"
_CHANGED = "is not what was written: its digest is another; make it again"


def sealed_rows(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """Header and rows of a table with its digest."""
    seal = _MARK + digest([list(header), *map(list, rows)])
    return [[*header, seal], *([*row, ""] for row in rows)]


def opened_rows(
    place: str, header: list[str], rows: list[list[str]]
) -> tuple[list[str], list[list[str]]]:
    """The same without its digest, if it has one, or `InputError` if it is not that of the rest."""
    if not header or not header[-1].startswith(_MARK):
        return header, rows
    found, own = header[:-1], [row[:-1] for row in rows]
    if sealed_rows(found, own) != [header, *rows]:
        raise InputError(place, _CHANGED)
    return found, own


def sealed(tree: dict[str, Any]) -> dict[str, Any]:
    """The tree with its digest, to be written as JSON."""
    return {**tree, _KEY: digest(json.loads(json.dumps(tree, allow_nan=False)))}


def opened(place: str, tree: dict[str, Any], must_be_sealed: bool = False) -> dict[str, Any]:
    """The tree read as JSON without its digest, or `InputError` if that is not of the rest."""
    rest = {name: part for name, part in tree.items() if name != _KEY}
    if (must_be_sealed or _KEY in tree) and tree.get(_KEY) != digest(rest):
        raise InputError(place, _CHANGED)
    return rest


def digest(content: Any) -> str:
    """A short hash of what JSON can hold, the same for the same content."""
    text = json.dumps(content, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
