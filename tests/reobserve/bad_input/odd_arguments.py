"""Odd arguments: objects, numbers, and arrays that differ from a valid one in one respect."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pandas as pd
from scipy import sparse


class NoArray:
    def __array__(self, *_: Any, **__: Any) -> Any:
        raise RuntimeError("no array")


class NoRepr:
    def __repr__(self) -> str:
        raise RuntimeError("no repr")


# Objects of other types, some made of the valid argument.
THINGS: Sequence[Callable[[Any], Any]] = [
    lambda _: None, lambda _: b"1", lambda _: True, lambda _: False, lambda _: object(),
    lambda _: float, lambda _: {1.0}, lambda _: {"a": 1}, lambda _: {}, lambda _: np,
    lambda _: lambda *_: 0.0, lambda _: lambda: None, lambda _: (k for k in range(3)),
    lambda _: (), lambda _: [], lambda _: ["1", "2"], lambda _: [[[[1.0]]]],
    lambda _: [[1.0], []], lambda _: [None], lambda _: [object()], lambda _: ["a", "a"],
    lambda _: datetime(2020, 1, 1), lambda _: ValueError("x"), lambda _: NoArray(),
    lambda _: NoRepr(), lambda _: range(10**9), lambda _: slice(3),
    lambda one: [one], lambda one: (one, one), lambda one: {"a": one}, lambda one: iter([one]),
]  # fmt: skip
NUMBERS = [
    0, -0.0, 1, -1, 2, 3, 1.5, 1e-300, 1e-9, 1e9, 1e150, 5e299, 1e300, -1e300, 1e308, -1e308,
    5e-324, 2**31, 2**63, 2**70, 10**400, -(2**63), -(2**64), 2**31 + 1, 2**32,
    2**63 - 2, 2**63 - 1, 2**64 - 1, 2**64, 2**128 + 1, np.float32(0.1), np.int8(1),
    np.uint64(2**63), np.float16(1), np.longdouble("1e400"), Fraction(1, 3), Decimal("0.1"),
    np.array(1.0), np.array([1.0]), float("inf"), -float("inf"), 10**6,
]  # fmt: skip
COUNTS = (10**4, 10**10)
SIZES = (1e12, 1e150, 1e308, -1e308, 1e-12, 1e-300, 5e-324, -1.0, 0.0)
# Arrays that differ from a valid one in one respect, of it and a mask of one entry.
ARRAYS: Sequence[Callable[[Any, Any], Any]] = [
    *[lambda a, m, x=x: np.where(m, x, a) for x in (np.inf, *SIZES)],
    *[lambda a, _, x=x: np.full(a.shape, x) for x in SIZES],
    *[lambda a, _, to=to: a.astype(to) for to in ("O", "M8[s]", "?", "f4", "g", ">f8", "l")],
    *[lambda a, _, n=n: np.broadcast_to(a.flat[:1].sum(), (n, *a.shape[1:])) for n in COUNTS],
    *[lambda a, _, n=n: np.broadcast_to(a.flat[:1].sum(), (*a.shape[:-1], n)) for n in COUNTS],
    lambda a, _: np.resize([1e150, 1e-300, 0.0], a.shape), lambda a, _: -a,
    lambda a, m: np.random.default_rng(int(np.flatnonzero(m).sum())).normal(0.0, 3.0, a.shape),
    lambda a, m: np.where(m, None, a.astype(object)),
    lambda a, m: np.ma.masked_array(a, m & False),
    lambda a, _: np.broadcast_to(a, a.shape),  # may not be written to
    lambda a, _: np.frombuffer(b" " + a.tobytes(), offset=1).reshape(a.shape),
    lambda a, _: np.repeat(np.atleast_1d(a), 2, axis=-1)[..., ::2],
    lambda a, _: np.asfortranarray(a), lambda a, _: np.atleast_1d(a)[::-1], lambda a, _: a.T,
    lambda a, _: np.atleast_1d(a)[:-1], lambda a, _: np.vstack([a, np.atleast_2d(a)[:1]]),
    lambda a, _: np.append(a, a.ravel()[:1]), lambda a, _: np.atleast_1d(a)[:0],
    lambda a, _: np.atleast_1d(a)[..., :0], lambda a, _: a[None], lambda a, _: a[..., None],
    lambda a, _: np.stack([a, a]), lambda a, _: a.ravel(), lambda a, _: a.tolist(),
    lambda a, _: tuple(map(tuple, np.atleast_2d(a))) if a.ndim < 3 else tuple(a),
    lambda a, _: pd.DataFrame(a) if a.ndim == 2 else pd.Series(a.ravel()),
    lambda a, _: np.asmatrix(a.ravel() if a.ndim > 2 else a),
    lambda a, _: sparse.csr_matrix(a.ravel() if a.ndim > 2 else a),
    lambda *_: np.broadcast_to(0.0, (10**6, 10**6)), lambda *_: np.zeros(3, dtype=[("a", float)]),
]  # fmt: skip
# What must never be accepted as a number, by the names used in `Call.takes`.
NEVER: Sequence[tuple[str, Callable[[Any, Any], Any]]] = [
    ("complex", lambda *_: 1j), ("complex", lambda *_: 1 + 2j), ("complex", lambda a, _: a + 1j),
    ("not a number", lambda *_: float("nan")), ("not a number", lambda *_: Decimal("nan")),
    ("not a number", lambda a, m: np.where(m, np.nan, a)),
    ("not a number", lambda a, m: pd.Series(a.ravel()).mask(m.ravel()).convert_dtypes()),
    ("a masked entry", lambda *_: np.ma.masked), ("a masked entry", np.ma.masked_array),
    ("text", lambda *_: np.str_("1")), ("text", lambda a, _: a.astype(str)),
]  # fmt: skip


def other_array(change: Callable[[Any, Any], Any], valid: Any, at: int) -> Any:
    """A changed array, with one entry in the mask."""
    array = np.array(valid, dtype=np.float64)
    mask = np.arange(array.size).reshape(array.shape) == at % max(array.size, 1)
    with np.errstate(all="ignore"):
        return change(array, mask)
