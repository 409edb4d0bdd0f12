"""Keys as types: a tree of settings read into frozen dataclasses, what is wrong named by its key.

A branch of a ledger is declared as a dataclass whose fields are its keys:

    @dataclass(frozen=True)
    class Plant:
        horizon: Positive
        step: Positive
        initial_rate: Annotated[list[float], vector(3)]

and `parse` makes one of plain data, or says which key is missing, unknown or wrong. A field with a
default may be left out. Where a branch has several forms, they are a union of dataclasses that one
word tells apart, a `Literal` in each (``algorithm: Literal["kalman"]``), or else the keys that they
need. A mapping holds branches under names of the user's. `Annotated` adds conditions to a type:
functions of place and value that raise `InputError`; see `reobserve.ledger.conditions`. Values are
kept as they stand, so that what is hashed is what is used, but for lists that a type wants as
tuples or as arrays of floats.

Files that stages write are read in the same way.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from types import UnionType
from typing import (
    Annotated,
    Any,
    Literal,
    TypeVar,
    Union,
    get_args,
    get_origin,
    get_type_hints,
    overload,
)

import numpy as np

from reobserve.errors import InputError, located, nearest, shown
from reobserve.numerics.matrices import as_floats

Type = TypeVar("Type")

_LARGEST = 2**63  # beyond it a whole number is no number of numpy's


@overload
def parse(kind: type[Type], tree: object, place: str = "") -> Type: ...


@overload
def parse(kind: Any, tree: object, place: str = "") -> Any: ...


def parse(kind: Any, tree: object, place: str = "") -> Any:
    """``tree`` as a ``kind``; what is one already is returned as it is.

    Parameters
    ----------
    kind
        A dataclass that declares the keys, a union of such, or a type that a field may have.
    tree
        Plain data: mappings, lists, numbers, words.
    place
        The dotted key under which it stands, for errors.

    Raises
    ------
    InputError
        With the dotted key of what is missing, unknown or no value of its type.
    """
    if is_dataclass(kind):
        return _branch(kind, tree, place)
    origin, inner = get_origin(kind), get_args(kind)
    # From Python 3.12 on, numpy's NDArray is a name of its own for what it stands for.
    origin = get_origin(getattr(origin, "__value__", None)) or origin
    if origin in (Union, UnionType):
        return _union(inner, tree, place)
    if origin is not None:
        return _READERS[origin](inner, tree, place)
    is_one, called = _LEAVES[kind]
    if not is_one(tree):
        raise InputError(place, f"{shown(tree)} {called}")
    return tree


def join(place: str, name: object) -> str:
    """The dotted key of ``name`` under ``place``."""
    return f"{place}.{name}" if place else str(name)


def _annotated(inner: Any, tree: Any, place: str) -> Any:
    found = parse(inner[0], tree, place)
    for condition in inner[1:]:
        condition(place, found)
    return found


def _word(inner: Any, tree: Any, place: str) -> Any:
    if not isinstance(tree, str) or tree not in inner:
        raise InputError(place, f"{shown(tree)} must be {_one_of(inner)}")
    return tree


def _list(inner: Any, tree: Any, place: str) -> Any:
    if not isinstance(tree, list):
        raise InputError(place, f"{shown(tree)} must be a list of {_several(inner[0])}")
    return [parse(inner[0], one, join(place, index)) for index, one in enumerate(tree)]


def _several(kind: Any) -> str:
    """What the items of a list are called."""
    while get_origin(kind) is Annotated:
        kind = get_args(kind)[0]
    return {float: "numbers", int: "whole numbers", str: "words"}.get(kind, "terms")


def _tuple(inner: Any, tree: Any, place: str) -> Any:
    if inner[-1] is Ellipsis:
        return tuple(_list(inner, tree, place))
    if not isinstance(tree, list) or len(tree) != len(inner):
        raise InputError(place, f"{shown(tree)} must be a list of {len(inner)}")
    parts = enumerate(zip(inner, tree, strict=True))
    return tuple(parse(kind, one, join(place, index)) for index, (kind, one) in parts)


def _array(inner: Any, tree: Any, place: str) -> Any:
    """An array of finite floats, of any number of axes."""
    return as_floats(place, tree)


def _mapping(inner: Any, tree: Any, place: str) -> Any:
    _check_mapping(tree, place)
    return {name: parse(inner[1], one, join(place, name)) for name, one in tree.items()}


_READERS = {
    Annotated: _annotated,
    Literal: _word,
    list: _list,
    tuple: _tuple,
    np.ndarray: _array,
    dict: _mapping,
    Mapping: _mapping,
}


def _branch(kind: Any, tree: Any, place: str, form: str = "") -> Any:
    if isinstance(tree, kind):
        return tree
    _check_mapping(tree, place)
    hints, needed = _keys(kind)
    for name in tree:
        if name not in hints:
            raise InputError(join(place, name), f"unknown key{nearest(name, hints)}")
    for name in needed:
        if name not in tree:
            raise InputError(join(place, name), f"is missing; {form or _called(kind)} needs it")
    parts = {name: parse(hints[name], one, join(place, name)) for name, one in tree.items()}
    with located(place) if place else nullcontext():
        return kind(**parts)


def _called(kind: Any) -> str:
    """What a sentence calls a dataclass: `StoredLedger` is the stored ledger."""
    return "the " + re.sub(r"(?<=[a-z])(?=[A-Z])", " ", kind.__name__.lstrip("_")).lower()


def _union(kinds: tuple[Any, ...], tree: Any, place: str) -> Any:
    """One of several forms, or the first of several plain types that the value is of."""
    if not all(map(is_dataclass, kinds)):
        return parse(next((kind for kind in kinds if _is_of(kind, tree)), kinds[0]), tree, place)
    if isinstance(tree, kinds):
        return tree
    _check_mapping(tree, place)
    word, forms = _forms(kinds)
    if not word:  # the first form of which all is there that it needs
        full = (kind for kind in kinds if all(name in tree for name in _keys(kind)[1]))
        return _branch(next(full, kinds[-1]), tree, place)
    if word not in tree:
        raise InputError(join(place, word), f"is missing, must be {_one_of(forms)}")
    told = parse(Literal[tuple(forms)], tree[word], join(place, word))
    return _branch(forms[told], tree, place, f"the {word} {told}")


@cache
def _forms(kinds: tuple[Any, ...]) -> tuple[str, dict[str, Any]]:
    """The key whose word tells forms apart, and the forms by it; no key if there is none."""
    hints = [_keys(kind)[0] for kind in kinds]
    for name in hints[0]:
        words = [get_args(known.get(name)) for known in hints]
        told = {word: kind for kind, some in zip(kinds, words, strict=True) for word in some}
        literal = all(get_origin(known.get(name)) is Literal for known in hints)
        if literal and len(told) == sum(map(len, words)):
            return name, told
    return "", {}


@cache
def _keys(kind: Any) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The types of all keys of a dataclass, and which keys it needs."""
    hints = get_type_hints(kind, include_extras=True)
    given = [field for field in fields(kind) if field.init]
    optional = [f.default is not MISSING or f.default_factory is not MISSING for f in given]
    names = [field.name for field in given]
    return {name: hints[name] for name in names}, tuple(
        name for name, may_lack in zip(names, optional, strict=True) if not may_lack
    )


def _is_of(kind: Any, value: Any) -> bool:
    try:
        parse(kind, value, "")
    except InputError:
        return False
    return True


def _check_mapping(value: Any, place: str) -> None:
    if not isinstance(value, Mapping):
        raise InputError(place, f"{shown(value)} must be a mapping of keys to values")


def _one_of(words: Any) -> str:
    listed = ", ".join(map(str, words))
    return f"one of {listed}" if len(words) > 1 else listed


def _is_number(value: Any) -> bool:
    if isinstance(value, bool):
        return False
    if isinstance(value, int):
        return abs(value) <= _LARGEST
    return isinstance(value, float) and abs(value) < float("inf")


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < _LARGEST


_LEAVES: dict[Any, tuple[Any, str]] = {
    float: (_is_number, "is not a number, must be one that is finite"),
    int: (_is_whole, "must be a whole number"),
    bool: (
        lambda value: isinstance(value, bool),
        "must be one of true and false, not a word or a number",
    ),
    str: (lambda value: isinstance(value, str), "must be a word"),
    type(None): (lambda value: value is None, "must not be given"),
    Any: (lambda value: True, ""),
}
