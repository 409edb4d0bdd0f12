"""Plain data: what JSON can hold, bounded, from whichever text or hand it comes.

Everything that a user or a file hands over as a tree is checked here before anything reads it:
mappings with text as keys, lists, text, booleans, nothing, and numbers that a float holds.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from reobserve.errors import InputError, one_line, shown
from reobserve.plain_data.files import read_text

Tree = dict[str, Any]

# A ledger has some 3000 values, 8 deep; the series of a large normal form some 100 000.
DEPTH = 40
VALUES = 100_000
LETTERS = 2_000_000  # of all text in a tree
LARGEST = 2**53  # up to here every integer is a float
_STORED_VALUES = 5_000_000  # in a file that a stage wrote

_Place = tuple[Any, Any]  # of a value: that of what holds it, and its key there

_TOO_LARGE = "holds more values or text than anything that is read here needs"


def check_plain(tree: Any, place: str, values: int = VALUES) -> None:
    """Refuse what is no plain data, too deep, or too large; shared parts count each time.

    Raises
    ------
    InputError
        With the dotted path below ``place`` of the first thing that cannot be taken.
    """
    waiting: list[tuple[Any, _Place, int]] = [(tree, (None, place), 0)]
    letters = 0
    while waiting:
        value, here, depth = waiting.pop()
        values -= 1
        if isinstance(value, str):
            letters += len(value)
            if not _is_text(value):
                raise InputError(_spelled(here), "holds half a letter, which no file can")
        elif isinstance(value, Mapping | list | tuple):
            if depth >= DEPTH:
                raise InputError(_spelled(here), f"is nested deeper than {DEPTH} levels")
            if len(value) > values:
                raise InputError(place, _TOO_LARGE)
            letters += sum(map(len, _keys(value, here)))
            inner = value.items() if isinstance(value, Mapping) else enumerate(value)
            waiting.extend((part, (here, key), depth + 1) for key, part in inner)
        else:
            _check_leaf(value, here)
        if values < 0 or letters > LETTERS:
            raise InputError(place, _TOO_LARGE)


def _spelled(place: _Place) -> str:
    """The dotted path of a value."""
    keys: list[str] = []
    link: _Place | None = place
    while link is not None:
        link, key = link
        keys.append(one_line(key, 100) if link else str(key))
    return ".".join(reversed(keys))


def _keys(value: Mapping[Any, Any] | list[Any] | tuple[Any, ...], place: _Place) -> list[str]:
    keys = list(value) if isinstance(value, Mapping) else []
    for key in keys:
        if not isinstance(key, str) or not _is_text(key):
            raise InputError(_spelled(place), f"has the key {shown(key)}, must be text in quotes")
    return keys


def _is_text(word: str) -> bool:
    """Whether UTF-8 can spell it: half of a surrogate pair it cannot."""
    try:
        word.encode()
    except UnicodeEncodeError:
        return False
    return True


def _check_leaf(value: Any, place: _Place) -> None:
    if value is None or isinstance(value, bool):
        return
    if not isinstance(value, int | float):
        kind = type(value).__name__
        raise InputError(
            _spelled(place),
            f"is a {kind}; only numbers, text, true, false, lists and mappings are taken",
        )
    if isinstance(value, int) and abs(value) > LARGEST:
        raise InputError(
            _spelled(place), "is an integer beyond 2^53, must be one that a float holds"
        )
    if not math.isfinite(value):
        raise InputError(_spelled(place), f"{value} must be a finite number")


def parse_json(text: str, place: str, values: int = VALUES) -> Any:
    """Plain data from JSON text.

    Raises
    ------
    InputError
        If it is no JSON, names a key twice, or is no plain data; see `check_plain`.
    """
    try:
        tree = json.loads(text, object_pairs_hook=_once)
    except json.JSONDecodeError as error:
        raise InputError(place, f"is not JSON: {error}") from None
    except RecursionError:
        raise InputError(place, f"is nested deeper than {DEPTH} levels") from None
    except _TwiceError as twice:
        raise InputError(place, f"has the key {shown(twice.args[0])} twice") from None
    except ValueError:  # of an integer with thousands of digits
        raise InputError(place, "has an integer beyond 2^53") from None
    check_plain(tree, place, values)
    return tree


def read_json(path: str | Path) -> Tree:
    """The mapping in a JSON file that a stage wrote; raises as `read_text` and `parse_json`."""
    tree = parse_json(read_text(path), str(path), _STORED_VALUES)
    if not isinstance(tree, dict):
        raise InputError(str(path), "must be a mapping of keys to values")
    return tree


class _TwiceError(Exception):
    """A key that stands twice in one object."""


def _once(pairs: list[tuple[str, Any]]) -> Tree:
    found = dict(pairs)
    if len(found) < len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                raise _TwiceError(key)
            seen.add(key)
    return found
