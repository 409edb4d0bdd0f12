"""Calls of the library: each argument of each public signature takes any value, or is refused.

A call ends in a finite result, or in one sentence of the library's own, within 10 s and 1 GiB.
The valid calls, in which one or two arguments are replaced, are those of the docstrings.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pandas as pd
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import reobserve
from reobserve import KalmanFilter, LinearModel, normal_form_observer
from reobserve.detection import nees
from reobserve.systems.periods import wrapped
from tests.reobserve.bad_input.odd import WORDS, changed
from tests.reobserve.bad_input.outcome import is_accepted, limited_memory
from tests.reobserve.library.calls import Call, calls

SECONDS, MEMORY = 10.0, 1 << 30


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
# What must never be accepted as a number, by the names used in `Call.takes`.
NEVER: dict[str, list[Any]] = {
    "complex": [1j, 1 + 2j],
    "not a number": [float("nan"), np.float64("nan"), Decimal("nan")],
    "a masked entry": [np.ma.masked],
    "text": [np.str_("1"), "1.0"],
}


def arrays(valid: Any, at: int) -> dict[str, Callable[[], Any]]:
    """Arrays that differ from the valid one in one respect."""
    array = np.array(valid, dtype=np.float64)
    rows = array if array.ndim else array.reshape(1)
    mask = np.arange(array.size).reshape(array.shape) == at % max(array.size, 1)
    frozen = array.copy()
    frozen.flags.writeable = False
    sizes = (1e12, 1e150, 1e308, -1e308, 1e-12, 1e-300, 5e-324, -1.0, 0.0)
    return {
        "not a number": lambda: np.where(mask, np.nan, array),
        "infinite": lambda: np.where(mask, np.inf, array),
        **{f"one {x}": lambda x=x: np.where(mask, x, array) for x in sizes},
        **{f"all {x}": lambda x=x: np.full(array.shape, x) for x in sizes},
        "of all sizes": lambda: np.resize([1e150, 1e-300, 0.0], array.shape),
        "negated": lambda: -array,
        "random": lambda: np.random.default_rng(at).normal(0.0, 3.0, array.shape),
        "complex": lambda: array + 1j,
        "text": lambda: array.astype(str),
        "objects": lambda: array.astype(object),
        "times of day": lambda: array.astype("datetime64[s]"),
        "booleans": lambda: array > 0,
        "short": lambda: array.astype(np.float32),
        "integers": lambda: array.astype(np.int64),
        "a masked entry": lambda: np.ma.masked_array(array, mask),
        "a mask of nothing": lambda: np.ma.masked_array(array, np.zeros(array.shape, bool)),
        "read-only": lambda: frozen,
        "Fortran order": lambda: np.asfortranarray(array),
        "backwards": lambda: rows[::-1],
        "transposed": lambda: array.T,
        "one row less": lambda: rows[:-1],
        "one row more": lambda: np.concatenate([rows, rows[:1]]),
        "no rows": lambda: rows[:0],
        "no columns": lambda: rows[..., :0],
        "one axis more": lambda: array[None],
        "one axis more at the end": lambda: array[..., None],
        "two records": lambda: np.stack([array, array]),
        "flat": array.ravel,
        "lists": array.tolist,
        "tuples": lambda: tuple(map(tuple, array)) if array.ndim == 2 else tuple(rows),
        "a frame": lambda: pd.DataFrame(array) if array.ndim == 2 else pd.Series(rows.ravel()),
        "huge and empty": lambda: np.broadcast_to(0.0, (10**6, 10**6)),
        **{
            f"{count} along axis {axis}": lambda axis=axis, count=count: np.broadcast_to(
                array.take([0], axis) if array.shape[axis] else array,
                (*array.shape[:axis], count * bool(array.shape[axis]), *array.shape[axis + 1 :]),
            )
            for axis in range(array.ndim)
            for count in (10**4, 10**10)
        },
        "a matrix": lambda: np.asmatrix(array) if array.ndim == 2 else array,
        "records": lambda: np.zeros(3, dtype=[("a", float)]),
    }


def is_numeric(valid: Any) -> bool:
    if isinstance(valid, bool | str) or valid is None:
        return False
    try:
        return np.asarray(valid).dtype.kind in "iuf"
    except Exception:
        return False


def is_plain(valid: Any) -> bool:
    if isinstance(valid, dict):
        return all(isinstance(key, str) for key in valid) and is_plain([*valid.values()])
    if isinstance(valid, list | tuple):
        return all(map(is_plain, valid))
    return valid is None or isinstance(valid, str | int | float)


@st.composite
def shaped(draw: st.DrawFn) -> Any:
    """An array of any shape and type."""
    shape = draw(st.lists(st.sampled_from([0, 1, 2, 3, 5]), max_size=3))
    fill = draw(st.sampled_from([0.0, 1.0, -1.0, 1e-300, 1e300, np.nan, np.inf]))
    kind = draw(st.sampled_from(["f8", "f8", "f4", "i8", "c16", "O", "?", "U3", "M8[s]"]))
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return np.full(shape, fill).astype(kind)


@st.composite
def odd_argument(draw: st.DrawFn, valid: Any, others: Sequence[Any]) -> tuple[str, Any]:
    """A replacement for a valid argument, and its name."""
    kinds = [st.sampled_from(THINGS).map(lambda make: ("", make(valid)))]
    kinds.append((st.sampled_from(WORDS) | st.sampled_from(NUMBERS)).map(lambda one: ("", one)))
    kinds.append(shaped().map(lambda one: ("", one)))
    kinds.append(st.sampled_from([*others, None]).map(lambda one: ("", one)))
    if is_plain(valid) and not isinstance(valid, int | float | None):
        kinds += [changed(valid).map(lambda one: ("", one))] * 2
    if is_numeric(valid):
        made = arrays(valid, draw(st.integers(0, 50)))
        array = st.sampled_from(list(made)).map(lambda name: (name, made[name]()))
        never = [(name, one) for name, odd in NEVER.items() for one in odd]
        kinds += [array, array, array, st.sampled_from(never)]
    return draw(st.one_of(kinds))


# The sample of a state may lack its measurement; a required gain is inf where none suffices.
UNBOUNDED = ("sample", "required_observer_gain")


def not_finite(found: Any, place: str = "", depth: int = 6) -> Iterator[str]:
    """Where a result has numbers that are not finite."""
    if isinstance(found, float | complex | np.ndarray) and np.asarray(found).dtype != object:
        if np.asarray(found).dtype.kind in "fc" and not np.isfinite(found).all():
            yield place
    elif isinstance(found, list | tuple) and depth:
        for part in found:
            yield from not_finite(part, f"{place}[]", depth - 1)
    elif isinstance(found, np.ndarray) and found.ndim and depth:
        yield from not_finite(found.ravel()[:100].tolist(), place, depth)
    elif isinstance(found, Mapping) and depth:
        for name, part in found.items():
            if name not in UNBOUNDED:
                yield from not_finite(part, f"{place}.{name}", depth - 1)
    elif type(found).__module__.startswith("reobserve.") and depth:
        yield from not_finite(vars(found), place, depth - 1)


def made(call: Call, arguments: Sequence[Any]) -> Any:
    """The result of a call, without numpy's warnings and within the limits."""
    warnings.simplefilter("error", RuntimeWarning)
    with limited_memory(MEMORY):
        for last in (False, True):  # the first call may compile
            since = time.process_time()
            found = call.function(*arguments)
            if time.process_time() - since < SECONDS:
                return found
            assert not last, "took too long"
    return None


Odd = tuple[Call, Sequence[Any], bool]  # with other arguments, and if one may not be a number


def check(call: Call, arguments: Sequence[Any], never: bool) -> None:
    """Make a call with odd arguments."""
    found: list[Any] = []
    is_accepted(lambda: found.append(made(call, arguments)))
    assert not (found and never), "took for a number what is none"
    if not list(not_finite(arguments)):
        usual = set(not_finite(call.function(*call.arguments)))
        assert set(not_finite(found)) <= {f"[]{place}" for place in usual}, "is not finite"


@st.composite
def odd_calls(draw: st.DrawFn, calls: Callable[[], Mapping[str, Call]]) -> Odd:
    """One of the calls with one or two odd arguments."""
    every = list(calls().values())
    call: Call = draw(st.sampled_from([one for one in every if one.arguments]))
    arguments = [one.copy() if type(one) is np.ndarray else one for one in call.arguments]
    never = False
    places = st.integers(0, len(arguments) - 1)
    other: Call = draw(st.sampled_from(every))
    for at in draw(st.lists(places, min_size=1, max_size=2, unique=True)):
        name, arguments[at] = draw(odd_argument(call.arguments[at], other.arguments))
        # A type can be called, and what it raises when it is called is the caller's affair.
        assume(not (callable(call.arguments[at]) and callable(arguments[at])))
        numeric = is_numeric(call.arguments[at])
        never = never or (numeric and name in NEVER and name not in call.takes)
    return call, arguments, never


KALMAN = KalmanFilter(LinearModel([[1]], C=[[1]], Q=1, R=1))
RUN = KALMAN.run([0.0, 1.0], start=KALMAN.init([0], 1))
KNOWN = {"order": 0, "sampling_period": 0.1, "poles": [-1], "form": "transformed"}


def refused(function: Callable[..., object], valid: Any, odd: Any) -> Odd:
    """A call with an argument that may not be taken."""
    return Call("", function, (valid,)), (odd,), True


@settings(max_examples=10 * settings().max_examples)
@given(odd_calls(calls))
@example(refused(RUN.plot, None, 2.0))
@example(refused(lambda known: RUN.plot(known=known), None, [1.0]))
@example(refused(lambda time: KALMAN.run([0.0], start=KALMAN.init([0], 1), time=time), None, np))
@example(refused(lambda periods: wrapped([1.0, 2.0], periods), 1.0, [[1.0, 2.0]]))
@example(refused(lambda periods: wrapped([1.0], periods), 1.0, 1j))
@example(refused(lambda values: wrapped(values, 1.0), [1.0], "a"))
@example(refused(lambda state: nees(RUN, state), [[0.0], [1.0]], [[1e308], [1.0]]))
@example(
    refused(lambda x: normal_form_observer(["-a"], ["a"], ["a"], gain=x, **KNOWN), "series", 1)
)
def test_arguments_of_any_kind_are_taken_or_refused(odd: Odd) -> None:
    check(*odd)


def test_every_public_name_has_a_call() -> None:
    called = {name.partition(",")[0].rpartition(".")[2] for name in calls()}
    results = {"DivergenceError", "Estimate", "InputError", "Run"}  # not constructed by users
    assert set(reobserve.__all__) - called - results == set()
