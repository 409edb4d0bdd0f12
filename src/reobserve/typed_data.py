"""Plain data into the types that code works with: every key there, none too many, each of its type.

A file of ours is described by frozen dataclasses; `typed` builds them from what a reader got, or
says in one sentence which entry is not what its field asks for.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from reobserve.errors import InputError, located, shown

Type = TypeVar("Type")


def typed(kind: type[Type], value: Any, place: str) -> Type:
    """``value``, plain data, as a ``kind``.

    Parameters
    ----------
    kind
        A dataclass; its fields may be dataclasses, numbers, text, booleans, arrays of floats,
        tuples, lists and mappings of these, one of them or None, or anything (`Any`).
    value
        Plain data; see `reobserve.plain_data.check_plain`.
    place
        What a message calls it.

    Raises
    ------
    InputError
        With the path below ``place`` of what is missing, unknown or of another type, or what the
        dataclass itself refuses.
    """
    return cast(Type, _typed(kind, value, place))


def _typed(kind: Any, value: Any, place: str) -> Any:
    origin, parts = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        (other,) = (part for part in parts if part is not NoneType)
        return None if value is None else _typed(other, value, place)
    if is_dataclass(kind):
        found = _dataclass(kind, value, place)
    elif origin is np.ndarray:
        found = _array(value, place)
    elif origin in (tuple, list):
        found = _sequence(origin, parts, value, place)
    elif origin is dict:
        items = _mapping(value, place).items()
        found = {key: _typed(parts[1], one, f"{place}.{key}") for key, one in items}
    else:
        found = value if kind is Any else _leaf(kind, value, place)
    return found


def _mapping(value: Any, place: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(place, f"{shown(value)} must be a mapping of keys to values")
    return value


def _dataclass(kind: Any, value: Any, place: str) -> Any:
    hints, value = _hints(kind), _mapping(value, place)
    for field in fields(kind):
        if field.name not in value and field.init and field.default is MISSING:
            raise InputError(place, f"has no key {field.name!r}")
    for key in value:
        if key not in hints:
            raise InputError(place, f"has the unknown key {shown(key)}")
    parts = {name: _typed(hints[name], one, f"{place}.{name}") for name, one in value.items()}
    with located(place):
        return kind(**parts)


@cache
def _hints(kind: Any) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in fields(kind) if field.init}


def _sequence(origin: Any, parts: tuple[Any, ...], value: Any, place: str) -> Any:
    if not isinstance(value, list | tuple):
        raise InputError(place, f"{shown(value)} must be a list")
    if origin is list or parts[-1] is Ellipsis:
        parts = (parts[0],) * len(value)
    if len(value) != len(parts):
        raise InputError(place, f"has {len(value)} values, must have {len(parts)}")
    return origin(
        _typed(part, one, f"{place}[{index}]")
        for index, (part, one) in enumerate(zip(parts, value, strict=True))
    )


def _array(value: Any, place: str) -> Any:
    """An array of finite floats, of any number of axes."""
    rows: list[Any] = [value]
    while rows and isinstance(rows[0], list):
        if any(not isinstance(row, list) or len(row) != len(rows[0]) for row in rows):
            raise InputError(place, "must be a list of numbers, or of rows of one length")
        rows = [one for row in rows for one in row]
    for one in rows:
        _leaf(float, one, place)
    return np.array(value, dtype=np.float64)


def _leaf(kind: Any, value: Any, place: str) -> Any:
    allowed, text = _LEAVES[kind]
    if not isinstance(value, allowed) or (isinstance(value, bool) and kind is not bool):
        raise InputError(place, f"{shown(value)} must be {text}")
    if kind is float and not math.isfinite(value):
        raise InputError(place, f"{shown(value)} must be finite")
    return kind(value)


_LEAVES: dict[Any, tuple[Any, str]] = {
    float: (int | float, "a number"),
    int: (int, "a whole number"),
    bool: (bool, "true or false"),
    str: (str, "text"),
}
