"""The file of a resolved ledger, as a build writes it and every stage reads it: checked whole."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reobserve.errors import InputError, shown
from reobserve.ledger.config import check_name
from reobserve.ledger.overrides import is_entry
from reobserve.plain_data.json_data import read_json
from reobserve.plain_data.typed_tree import parse

# What every ledger has; which sections hold bodies, by name; and what these must name.
_REQUIRED = ("about", "plant", "scenarios", "observers", "metrics", "figures")
_BODIES = ("scenarios", "observers", "designs", "studies", "searches", "tables", "figures")
_NEEDED = {
    **dict.fromkeys(("studies", "searches", "figures"), ("scenario", "observers")),
    "tables": ("design",),
}
_NAMES = ("scenario", "study", "design")


@dataclass(frozen=True)
class StoredLedger:
    """What stands in the file."""

    paper: str
    seed: int
    ledger: dict[str, Any]


def read_stored(path: str | Path) -> StoredLedger:
    """A ledger from its file; whether what it names is there is not looked at.

    Raises
    ------
    InputError
        If the file is missing or damaged, or a section, a body or an entry is not what it must be.
    """
    place = str(path)
    stored = parse(StoredLedger, read_json(path), place)
    check_name(f"{place}.paper", stored.paper)
    for section in _REQUIRED:
        if section not in stored.ledger:
            raise InputError(place, f"has no section {section!r}; build the ledger anew")
    for section, bodies in stored.ledger.items():
        _check_mapping(bodies, f"{place}.{section}")
        for name, body in bodies.items() if section in _BODIES else ():
            _check_body(section, body, f"{place}.{section}.{name}")
    for key, entry in _entries(stored.ledger, place):
        for part in ("unit", "source"):
            if not isinstance(entry.get(part), str):
                raise InputError(key, f"has no {part}")
    return stored


def _check_mapping(value: Any, place: str) -> None:
    if not isinstance(value, Mapping):
        raise InputError(place, f"is {shown(value)}, must be a mapping")


def _check_body(section: str, body: Any, place: str) -> None:
    """What a body names, where it must or may."""
    _check_mapping(body, place)
    for key in _NEEDED.get(section, ()):
        if key not in body:
            raise InputError(place, f"has no {key}")
    for key in filter(body.__contains__, _NAMES):
        if not isinstance(body[key], str):
            raise InputError(f"{place}.{key}", f"is {shown(body[key])}, must be a name")
    names = body.get("observers", [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InputError(f"{place}.observers", f"is {shown(names)}, must be a list of names")


def _entries(branch: Any, place: str) -> Iterator[tuple[str, Mapping[str, Any]]]:
    if is_entry(branch):
        yield place, branch
    elif isinstance(branch, Mapping):
        for key, value in branch.items():
            yield from _entries(value, f"{place}.{key}")
