"""Each construct of the subset gives in C the very numbers that its compiled kernel gives."""

from __future__ import annotations

import inspect
import math
import re
import shutil
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.kernel import allocating_kernel, kernel
from tests.reobserve.codegen.in_c import in_c

Array = NDArray[Any]
SIZE = 8
TABLE = np.arange(12.0).reshape(3, 4) - 4.5


class Pair(NamedTuple):
    first: Any
    second: Any


def descending(x: Array, out: Array) -> int:
    n, total = len(x), 0.0
    for i in range(n - 1, -1, -1):
        total = 0.5 * total + x[i]
        out[i] = total
    for back in range(n):
        i = n - 1 - back
        out[i] += x[back]
    return 0


def jumps(x: Array, out: Array) -> int:
    count = 0
    for i in range(len(x)):
        out[i] = -1.0
        if x[i] < 0.0:
            continue
        for j in range(len(x)):
            if x[j] > x[i]:
                break
            out[i] = x[j]
        if x[i] > 0.5:
            for place, value in ((0, x[1]), (1, x[2]), (2, x[3])):
                if place == 1:
                    break
                out[i] += value
        if count == 3:
            break
        count += 1
    out[0] = count
    return 0


def short(x: Array, out: Array) -> int:
    four = (1.0, 2.0, 3.0, 4.0)
    last = 0
    for i in range(2):
        if x[i] > 0.0:
            last += i + 1
    for i in range(3):
        for j in range(2):
            out[i] = x[j] if x[i] > x[j] else float(last)
    for k in range(5):
        total = 0.0
        for i in range(2):
            total += x[i] * i
            if total > x[k]:
                last = i + k
        for i in range(len(four)):
            total += four[i] * x[i]
        out[3 + k] = total + last
    for i in range(2):
        for j in range(2):
            if x[i] > 10.0 * x[j]:
                return 0
    return 0


@kernel
def _clipped(value: float, least: float, most: float) -> float:
    if value < least:
        return least
    if value > most:
        return most
    return value


@kernel
def _both(value: float, out: Array) -> bool:
    out[0] += value
    return value > 0.0


@kernel
def _divided(a: float, b: float, scale: float = 1.0) -> tuple[float, float]:
    """Find a*/b, /* or its inverse."""
    return scale * a / b, a * b


@kernel
def _twice(function: Any, value: float) -> float:
    return function(function(value, -1.0, 1.0), -0.5, 2.0)  # type: ignore[no-any-return]


def calls(x: Array, out: Array) -> int:
    out[0] = _clipped(x[0], -0.5, 0.5) + _clipped(x[1], x[2], x[3])
    out[1] = _twice(_clipped, x[4])
    quotient, product = _divided(x[5], x[6])
    out[2], out[3] = quotient, product
    out[4] = out[5] = 0.0
    if x[0] > 0.0 and _both(x[1], out[4:]):
        out[5] = 1.0
    if x[2] > 0.0 or not _both(x[3], out[4:]):
        out[5] += 2.0
    out[6] = out[7] = 0.0
    return 0


def conditions(x: Array, out: Array) -> int:
    for i in range(len(x)):
        small, sign = -0.5 < x[i] <= 0.5, 0.0
        if x[i] != 0.0:
            sign = 1.0 if x[i] > 0.0 else -1.0
        elif not small:
            sign = math.nan
        out[i] = sign * (2.0 if i in (1, 3) else 1.0) + (10.0 if small else 0.0)
        out[i] += 100.0 if not x[i] >= 0.0 or (small and i > 2) else 0.0
    return 0


def extremes(x: Array, out: Array) -> int:
    for i in range(len(x) - 2):
        out[i] = min(x[i], x[i + 1], x[i + 2]) - 3.0 * max(x[i + 1], x[i], 0.25)
    out[6], out[7] = min(max(x[0], -0.1), 0.1), max(abs(x[1]), -x[2])
    return 0


def powers(x: Array, out: Array) -> int:
    out[0], out[1], out[2] = x[0] ** 2, x[1] ** 3, (x[2] + x[3]) ** 7
    out[3], out[4] = (abs(x[4]) + 1.0) ** -2, x[5] ** 17
    out[5], out[6] = abs(x[6]) ** 0.3, 2 ** x[7]
    out[7] = x[0] ** 4 - x[1] ** 0 + x[2] ** 1
    return 0


def swaps(x: Array, out: Array) -> int:
    a, b, c = x[0], x[1], x[2]
    newest, former = (a, b), (b, c)
    for i in range(len(x)):
        a, b = b, a + x[i]
        former, newest = newest, (newest[1], former[0] - x[i])
        out[i] = a
    out[0], out[7] = out[7], out[0]
    out[1], out[2] = newest
    (out[3], c), out[4] = former, a
    out[5] = c
    return 0


def views(x: Array, out: Array) -> int:
    square, part = x[:4].reshape((2, 2)), out[2:6]
    for i in range(len(part)):
        part[i] = x[i : i + 1][0] * TABLE[i // 2, i % 2]
    for i in range(2):
        row = square[i]
        out[i] = row[0] - row[1]
        part[i] += TABLE[:, 1][i] * square[:, i][1]
    last = out[6:]
    last[0], last[-1] = TABLE[-1, -1], len(TABLE[0])
    return 0


def numbers(x: Array, out: Array) -> int:
    left, held = len(x), 0
    for i in range(len(x)):
        if x[i] > 0.0:
            left -= 1
            held = -1 if i > 3 else 1
        factor = -x[i] / (i + 1)
        out[i] = left * 0.1 + held * x[i] + factor + (i + 1) // 2 - i % 3
    return 0


def choices(x: Array, out: Array) -> int:
    h = x[0]
    for i in range(4):
        out[i] = (0.0, 0.5 * h, h - 1.0, h)[i] * (1.0, 2.0, 2.0, 1.0)[i]
    out[4] = out[5] = 0.0
    for value in x:
        out[4] += value
    for first, second in ((x[1], 0), (x[2], 1)):
        out[5] += first * second
    scratch = np.empty((2, 2))
    for i in range(2):
        scratch[i, 1 - i] = x[i]
        scratch[i, i] = -x[i]
    out[6], out[7] = scratch[0, 1] - scratch[1, 0], scratch[1, 1]
    return 0


def functions(x: Array, out: Array) -> int:
    a = abs(x[0])
    out[0], out[1], out[2] = math.exp(x[1]), math.log(a), math.sqrt(a) * math.pi
    out[3], out[4] = math.atan2(x[2], x[3]), x[4] - math.floor(3.0 * x[4])
    out[5] = math.erf(x[5]) if math.isfinite(x[6]) and not math.isnan(x[7]) else math.inf
    out[6], out[7] = math.tanh(x[7]) - math.cosh(0.5), math.sin(x[0]) / math.cos(x[0])
    return 0


def changed(x: Array, out: Array) -> int:
    out[0] = _shrunk(x[0], 1.0)
    out[1] = _shrunk(x[1], x[2])
    for i in range(2, len(x)):
        out[i] = 0.0
    return 0


@kernel
def _shrunk(d: float, here: float) -> float:
    for i in range(5):
        d /= 2.0 + i
        if d < here:
            here = d
        elif d > here:
            here = here + 0.25 * d
    return here


def fields(x: Array, out: Array, pair: Pair, same: Pair) -> int:
    """Two tuples of the same shape, of which one has twice the same array."""
    for one in (pair, same):
        for i in range(2):
            one.first[i] = x[i]
            one.second[i] = x[i + 2] + one.first[i]
    for i in range(2):
        out[i], out[2 + i] = pair.first[i], pair.second[i]
        out[4 + i], out[6 + i] = same.first[i], same.second[i]
    return 0


def absent(x: Array, out: Array, pair: Pair) -> int:
    if pair.second is not None:
        return 1
    for i in range(len(x)):
        out[i] = x[i] * pair.first
    return 0


shared = np.zeros(2)
CONSTRUCTS: dict[Callable[..., int], tuple[Any, ...]] = {
    **dict.fromkeys((descending, jumps, calls, conditions, extremes, powers, swaps, views), ()),
    **dict.fromkeys((numbers, choices, functions, changed, short), ()),
    fields: (Pair(np.zeros(2), np.zeros(2)), Pair(shared, shared)),
    absent: (Pair(2.5, None),),
}


def points() -> list[Array]:
    random = np.random.default_rng(5)
    drawn = [random.normal(size=SIZE) for _ in range(12)]
    return [*drawn, np.where(drawn[0] > 0.5, np.nan, drawn[1]), np.zeros(SIZE)]


@pytest.mark.nightly_after(2)
@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no compiler of C")
@pytest.mark.parametrize("construct", CONSTRUCTS, ids=lambda one: one.__name__)
def test_construct_gives_in_c_what_its_kernel_gives(construct: Any) -> None:
    more = CONSTRUCTS[construct]
    found, compiled = (
        in_c(construct, np.empty(SIZE), np.empty(SIZE), *more),
        allocating_kernel(construct),
    )
    for x in points():
        out = np.full(SIZE, np.nan)
        assert compiled(x.copy(), out, *more) == 0
        assert found(x).tobytes() == out.tobytes() or np.array_equal(found(x), out, equal_nan=True)


def endless(x: Array, out: Array) -> int:
    while x[0] > 0.0:
        out[0] = x[0]
    return 0


def guarded(x: Array, out: Array) -> int:
    try:
        out[0] = x[0]
    finally:
        out[1] = x[1]
    return 0


def listed(x: Array, out: Array) -> int:
    out[0] = [value for value in x][0]  # noqa: C416, RUF015
    return 0


def unknown(x: Array, out: Array) -> int:
    out[0] = math.gamma(x[0])
    return 0


def constant(x: Array, out: Array) -> int:
    x[0] = out[0]
    return 0


def negative(x: Array, out: Array) -> int:
    for i in range(4):
        out[i] = x[(i - 2) // 2]
    return 0


def several(x: Array, out: Array) -> int:
    part = x[1:]
    if x[0] > 0.0:
        part = x[2:]
    out[0] = part[0]
    return 0


def stepped(x: Array, out: Array) -> int:
    for i in range(0, 8, 2):
        out[i] = x[i]
    return 0


def moving(x: Array, out: Array) -> int:
    part = x[:4]
    for i in range(4):
        out[i] = part[0]
        part = x[4:]
    return 0


def inside(x: Array, out: Array) -> int:
    out[0] = 1.0 + _both(x[0], out)
    return 0


def beyond(x: Array, out: Array) -> int:
    out[0] = x[8]
    return 0


def paired(x: Array, out: Array) -> int:
    for i, value in enumerate(x):
        out[i] = value
    return 0


REFUSED = {
    paired: ("a call of enumerate", 1),
    endless: ("While", 1), guarded: ("Try", 1), listed: ("ListComp", 1),
    unknown: ("the function gamma", 1), constant: ("no entry of an array that is written", 1),
    negative: ("a division with remainder of what may be negative", 2),
    several: ("part, which stands for several things here", 4),
    stepped: ("a range with another step", 1), moving: ("part stands for another array", 4),
    inside: ("a call of _both, which writes to arrays, inside an expression", 1),
    beyond: ("an index beyond the end", 1),
}  # fmt: skip


@pytest.mark.parametrize("function", REFUSED, ids=lambda one: one.__name__)
def test_what_is_not_known_is_refused_with_its_place(function: Any) -> None:
    said, below = REFUSED[function]
    line = inspect.getsourcelines(function)[1] + below
    place = rf"^observer: cannot be exported: {re.escape(__file__)}, line {line}: .*{said}"
    with pytest.raises(InputError, match=place):
        in_c(function, np.empty(SIZE), np.empty(SIZE))
