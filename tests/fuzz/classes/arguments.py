"""Arguments of the library's public classes and functions: wrong types, shapes and numbers."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from datetime import datetime
from decimal import Decimal
from fractions import Fraction
from random import Random
from typing import Any

import numpy as np
import pandas as pd

from ..case import Case, shown
from ..subjects import Subject, subjects


def make(random: Random) -> Case:
    """A call with one or two arguments changed, one left out, or one too many."""
    known = subjects()
    subject = known[random.choice([*known])]
    arguments = list(subject.arguments)
    changed: dict[int, str] = {}
    for _ in range(random.choice([1, 1, 1, 2]) if arguments else 0):
        at = random.randrange(len(arguments))
        changed[at], arguments[at] = _odd(random, subject.arguments[at])
    told = "; ".join(f"argument {at + 1} = {what}" for at, what in changed.items())
    wrong = [
        f"argument {at + 1} is {what}"
        for at, what in changed.items()
        if what in _NEVER and _numeric(subject.arguments[at]) and what not in subject.takes
    ]
    return case(subject, arguments, told, ", ".join(wrong))


def examples() -> Iterator[Case]:
    """Every call with the arguments that it should have."""
    for subject in subjects().values():
        yield case(subject, list(subject.arguments), "as it should be")


def case(subject: Subject, arguments: list[Any], told: str, never: str = "") -> Case:
    """Make the call."""

    def run() -> None:
        subject.call(*(_own(argument) for argument in arguments))

    return Case(f"{subject.name}: {told}", run, never=never)


def _own(argument: Any) -> Any:
    """A copy of what a call might change."""
    return argument.copy() if type(argument) is np.ndarray and argument.size < 1e6 else argument


def _numeric(valid: Any) -> bool:
    if isinstance(valid, bool | str) or valid is None:
        return False
    try:
        return np.asarray(valid).dtype.kind in "iuf"
    except Exception:
        return False


# What may never pass for a number or numbers, and what it is called.
_NEVER = ("text", "a masked entry", "complex", "not a number")


def _odd(random: Random, valid: Any) -> tuple[str, Any]:
    makers: list[Callable[[Random, Any], tuple[str, Any]]] = [_thing]
    if _numeric(valid):
        makers += [_number, _array, _array, _array]
    return random.choice(makers)(random, valid)


def _thing(random: Random, valid: Any) -> tuple[str, Any]:
    """An object of another kind."""
    return random.choice([
        ("nothing", None), ("text", "text"), ("text", ""), ("text", "1.0"), ("text", "x" * 20_000),
        ("bytes", b"1"), ("a dict", {}), ("a dict", {"a": 1}), ("an object", object()),
        ("a type", float),
        ("a function", lambda *_: 0.0), ("a set", {1.0}), ("a generator", (k for k in range(3))),
        ("a tuple", ()), ("a list", []), ("a deep list", [[[[1.0]]]]),
        ("rows of two lengths", [[1.0], []]),
        ("a list with nothing", [None]), ("a list of texts", ["1", "2"]), ("true", True),
        ("false", False),
        ("a date", datetime(2020, 1, 1)), ("an exception", ValueError("x")), ("a module", np),
        ("a list of it", [valid]), ("a pair of it", (valid, valid)),
        ("a list of objects", [object()]),
        ("what cannot be an array", _NoArray()), ("what cannot be shown", _NoRepr()),
    ])  # fmt: skip


def _number(random: Random, valid: Any) -> tuple[str, Any]:
    """One number where one, or many, should be."""
    new = random.choice([
        0, -0.0, 1, -1, 2, 1.5, 1e-300, 1e300, -1e300, 5e-324, 2**31, 2**63, 2**70, 10**400,
        np.float32(0.1), np.int8(1), np.uint64(2**63), np.float16(1), np.longdouble("1e400"),
        Fraction(1, 3), Decimal("0.1"), np.array(1.0), np.array([1.0]),
    ])  # fmt: skip
    if random.random() < 0.25:
        return random.choice([
            ("complex", 1j), ("complex", 1 + 2j), ("not a number", float("nan")),
            ("infinite", float("inf")), ("infinite", -float("inf")),
            ("a masked entry", np.ma.masked),
            ("text", np.str_("1")), ("not a number", np.float64("nan")),
            ("not a number", Decimal("nan")),
        ])  # fmt: skip
    return f"the number {shown(new)}", new


def _array(random: Random, valid: Any) -> tuple[str, Any]:
    """An array like the valid one, but for one thing."""
    array = np.array(valid, dtype=np.float64)
    rows = array.reshape(-1, *array.shape[1:]) if array.ndim else array.reshape(1)
    at = random.randrange(max(array.size, 1))
    readonly = array.copy()
    readonly.flags.writeable = False
    mask = np.zeros(array.shape, bool)
    mask.ravel()[at : at + 1] = True
    makers: dict[str, Callable[[], Any]] = {
        "not a number": lambda: _put(array, at, np.nan),
        "infinite": lambda: _put(array, at, np.inf),
        "huge": lambda: _put(array, at, 1e308),
        "all huge": lambda: np.full(array.shape, 1e308),
        "times 1e12": lambda: array * 1e12,
        "all tiny": lambda: np.full(array.shape, 1e-308),
        "zeros": lambda: np.zeros(array.shape),
        "negated": lambda: -array,
        "random": lambda: np.random.default_rng(at).normal(0.0, 3.0, array.shape),
        "complex": lambda: array + 1j,
        "text": lambda: array.astype(str),
        "objects": lambda: array.astype(object),
        "times of day": lambda: array.astype("datetime64[s]"),
        "truths": lambda: array > 0,
        "short": lambda: array.astype(np.float32),
        "long": lambda: array.astype(np.longdouble),
        "whole": lambda: array.astype(np.int64),
        "a masked entry": lambda: np.ma.masked_array(array, mask),
        "a mask of nothing": lambda: np.ma.masked_array(array, np.zeros(array.shape, bool)),
        "read-only": lambda: readonly,
        "Fortran order": lambda: np.asfortranarray(array),
        "every second of twice": lambda: np.repeat(rows, 2, axis=0)[::2],
        "backwards": lambda: rows[::-1],
        "transposed": lambda: array.T,
        "one row less": lambda: rows[:-1],
        "one row more": lambda: np.concatenate([rows, rows[:1]]),
        "no rows": lambda: rows[:0],
        "one axis more": lambda: array[None],
        "one axis more at the end": lambda: array[..., None],
        "flat": array.ravel,
        "lists": array.tolist,
        "tuples": lambda: tuple(map(tuple, array)) if array.ndim == 2 else tuple(rows),
        "a frame": lambda: pd.DataFrame(array) if array.ndim == 2 else pd.Series(rows.ravel()),
        "a frame with text": lambda: pd.DataFrame({"a": ["x"] * len(rows)}),
        "of another byte order": lambda: array.astype(">f8"),
        "huge and empty": lambda: np.broadcast_to(0.0, (10**6, 10**6)),
        "a matrix": lambda: np.asmatrix(array) if array.ndim == 2 else array,
        "records": lambda: np.zeros(3, dtype=[("a", float)]),
    }  # fmt: skip
    what = random.choice([*makers])
    return what, makers[what]()


def _put(array: Any, at: int, value: float) -> Any:
    changed = copy.deepcopy(array)
    if changed.size:
        changed.ravel()[at] = value
    return changed if changed.ndim else np.array(value)


class _NoArray:
    def __array__(self, *_: Any, **__: Any) -> Any:
        raise RuntimeError("no array")


class _NoRepr:
    def __repr__(self) -> str:
        raise RuntimeError("no repr")
