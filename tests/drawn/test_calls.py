"""Calls of the library: each argument of each public signature takes any value, or is refused.

A call ends in a finite result, or in one sentence of the library's own, within 10 s and 1 GiB.
The valid calls, in which one or two arguments are replaced, are those of the docstrings.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache, wraps
from itertools import islice
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np
import pandas as pd
from hypothesis import example, given
from hypothesis import strategies as st

import reobserve
from reobserve import KalmanFilter, LinearModel, normal_form_observer, tune
from reobserve.detection import glr_of_mean, nees
from reobserve.systems.periods import wrapped
from tests.reobserve.bad_input.odd import WORDS, changed
from tests.reobserve.bad_input.odd_arguments import ARRAYS, NEVER, NUMBERS, THINGS, other_array
from tests.reobserve.bad_input.outcome import RefusedError, is_accepted, limited_memory
from tests.reobserve.library.calls import Call, calls
from tests.reobserve.library.test_wrong_kinds import parameters

from . import times

SECONDS, MEMORY = 10.0, 1 << 30


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


# Valid arguments that the calls leave out.
USUAL: dict[str, list[Any]] = {
    "D": [[[0.5]]], "S": [[[1e-3], [0.0]], np.full((20, 2, 1), 1e-3)], "gate": [9.0],
    "noise_memory": [50.0], "state_periods": [[6.28], {"x1": 6.28}], "output_periods": [[6.28]],
    "keep": ["gains", ["state"], 5], "names": [["x1"], "x1"], "known": [[[0.0, 0.0]] * 4],
    "output_fault_matrix": [[[1.0]]], "unknown_input": [[[1.0], [0.0]]], "lag": [3], "dt": [0.1],
    "unknown_input_names": [["d"]], "fault_names": [["f"]], "density": [True], "lambdas": [[1.0]],
    "fault_covariance": [[[1.0]]], "rate_covariance": [np.eye(3)], "probabilities": [[0.5, 0.5]],
}  # fmt: skip


@cache
def alike(calls: Callable[[], Mapping[str, Call]]) -> dict[str, list[Any]]:
    """Arguments that are not None, by their names in all calls."""
    found = {name: list(some) for name, some in USUAL.items()}
    for call in calls().values():
        for name, one in zip(parameters(call), call.arguments, strict=False):
            found.setdefault(name, []).extend([] if one is None else [one])
    return found


def picked(draw: st.DrawFn, options: Sequence[Any]) -> Any:
    """One of the options, of which hypothesis makes no label."""
    return options[draw(st.integers(0, len(options) - 1))]


def odd_function(draw: st.DrawFn, valid: Callable[..., Any]) -> Callable[..., Any]:
    """A function whose results are odd."""
    at, change, thing = draw(st.integers(0, 50)), picked(draw, ARRAYS), picked(draw, THINGS)
    by_array = draw(st.booleans())

    def odd(*arguments: Any) -> Any:
        result = valid(*arguments)
        return other_array(change, result, at) if by_array and is_numeric(result) else thing(result)

    return odd


def odd_argument(draw: st.DrawFn, valid: Any, others: Sequence[Any]) -> tuple[str, Any]:
    """A replacement for a valid argument, and its kind if that is no number."""

    def entry() -> Any:
        entries, at = list(valid), draw(st.integers(0, len(valid) - 1))
        entries[at] = odd_argument(draw, entries[at], others)[1]
        return type(valid)(entries)

    # A file may be given such a name.
    words = [one for one in WORDS if "escaped" not in one or not isinstance(valid, Path)]
    kinds: list[Callable[[], Any]] = [
        lambda: picked(draw, THINGS)(valid), lambda: picked(draw, words),
        lambda: picked(draw, NUMBERS), lambda: picked(draw, others),
    ]  # fmt: skip
    if isinstance(valid, FunctionType):
        kinds += [lambda: odd_function(draw, valid)] * 5
    elif is_plain(valid) and not isinstance(valid, int | float | None):
        kinds += [lambda: draw(changed(valid))] * 3
    elif isinstance(valid, list | tuple) and valid:
        kinds += [entry] * 3
    at = draw(st.integers(0, len(kinds) + 7 * is_numeric(valid) - 1))
    if at < len(kinds):
        return "", kinds[at]()
    kind, change = picked(draw, NEVER) if at < len(kinds) + 2 else ("", picked(draw, ARRAYS))
    return kind, other_array(change, valid, draw(st.integers(0, 50)))


def theirs(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of the caller's, whose affair is what it raises."""

    @wraps(function, updated=())
    def call(*arguments: Any) -> Any:
        try:
            return function(*arguments)
        except Exception as error:
            raise RefusedError("raised") from error

    return call if isinstance(function, FunctionType | type) else function


# Samples may lack measurements; a required gain is inf where none suffices.
UNBOUNDED = ("sample", "required_observer_gain", "y")


def numbers(found: Any, place: str = "", depth: int = 6) -> Iterator[tuple[str, Any]]:
    """The numbers of a result, and where they stand."""
    if isinstance(found, float | complex | np.ndarray | pd.DataFrame | pd.Series):
        array = np.asarray(found)
        if array.dtype.kind in "fciub":
            yield place, array
        elif array.dtype == object and array.ndim and depth:
            yield from numbers(array.ravel()[:100].tolist(), place, depth)
    elif found is pd.NA:
        yield place, np.array(np.nan)
    elif isinstance(found, list | tuple) and depth:
        for part in found:
            yield from numbers(part, f"{place}[]", depth - 1)
    elif isinstance(found, Mapping) and depth:
        for name, part in found.items():
            yield from numbers(part, f"{place}.{name}", depth - 1)
    elif type(found).__module__.startswith("reobserve.") and depth:
        yield from numbers(vars(found), place, depth - 1)


def not_finite(found: Any) -> set[str]:
    """Where a result has numbers that are not finite."""
    return {
        place
        for place, array in numbers(found)
        if array.dtype.kind in "fc" and not np.isfinite(array).all()
        if place.rpartition(".")[2] not in UNBOUNDED
    }


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


# Other arguments; the same as floats, if any is numeric; and if one may not be a number.
Odd = tuple[Call, Sequence[Any], Sequence[Any], bool]


def check(call: Call, arguments: Sequence[Any], plain: Sequence[Any], never: bool) -> None:
    """Make a call with odd arguments."""
    found: list[Any] = []
    is_accepted(lambda: found.append(made(call, arguments)))
    assert not (found and never), "took for a number what is none"
    if (odd := not_finite(found)) and not not_finite(arguments):
        usual = not_finite([call.function(*call.arguments)])
        assert odd <= usual, "is not finite"
    if found and plain and is_accepted(lambda: found.append(made(call, plain))):
        for (place, one), (_, other) in zip(*map(numbers, found), strict=True):
            assert np.array_equal(one, other, equal_nan=one.dtype.kind in "fc"), place


@st.composite
def odd_calls(draw: st.DrawFn, calls: Callable[[], Mapping[str, Call]]) -> Odd:
    """One of the calls with one or two odd arguments."""
    every = [one for one in calls().values() if one.arguments]
    call: Call = picked(draw, every)
    arguments = [one.copy() if type(one) is np.ndarray else one for one in call.arguments]
    names, other = list(islice(parameters(call), len(arguments))), picked(draw, every)
    never, plain = False, dict[int, Any]()
    for at in {draw(st.integers(0, len(arguments) - 1)) for _ in range(draw(st.integers(1, 2)))}:
        valid = call.arguments[at]
        same = alike(calls).get(names[at]) or [valid]
        likely = valid if valid is not None and draw(st.integers(0, 9)) else picked(draw, same)
        kind, arguments[at] = odd_argument(draw, likely, [*same, *other.arguments, None])
        takes = (*call.takes, kind if names[at] == "records" else "")  # which are the caller's
        never = never or (is_numeric(likely) and kind not in takes)
        with suppress(Exception):
            odd = kind or isinstance(arguments[at], range)  # that would fill the memory
            array = np.asarray(None if odd else arguments[at])
            if array.dtype.kind in ("fiuO" if array.ndim else "fiu") and array.size < 10**6:
                plain[at] = array.astype(float) if array.ndim else float(array)
    arguments = [theirs(one) if callable(one) else one for one in arguments]
    return call, arguments, plain and [plain.get(*one) for one in enumerate(arguments)], never


KALMAN = KalmanFilter(LinearModel([[1]], C=[[1]], Q=1, R=1))
RUN = KALMAN.run([0.0, 1.0], start=KALMAN.init([0], 1))
KNOWN = {"order": 0, "sampling_period": 0.1, "poles": [-1], "form": "transformed"}
HUGE, MASKED = np.broadcast_to(6.3, 10**10), np.ma.masked_array([1.0], [True])


def refused(function: Callable[..., object], valid: Any, odd: Any) -> Odd:
    """A call with an argument that may not be taken."""
    return Call("", function, (valid,)), (odd,), (), True


@times(10)
@given(odd_calls(calls))
@example(refused(RUN.plot, None, 2.0))
@example(refused(lambda known: RUN.plot(known=known), None, [1.0]))
@example(refused(lambda time: KALMAN.run([0.0], start=KALMAN.init([0], 1), time=time), None, np))
@example(refused(lambda periods: wrapped([1.0, 2.0], periods), 1.0, [[1.0, 2.0]]))
@example(refused(lambda periods: wrapped([1.0], periods), 1.0, 1j))
@example(refused(lambda values: wrapped(values, 1.0), [1.0], "a"))
@example(refused(lambda state: nees(RUN, state), [[0.0], [1.0]], [[1e308], [1.0]]))
@example(refused(lambda S: KALMAN.run([0.0], start=KALMAN.init([0], 1), S=S), None, [[1e308]]))
@example(refused(lambda R: KALMAN.run([0.0], start=KALMAN.init([0], 1), R=R, S=0), 1, []))
@example(refused(lambda p: LinearModel([[1]], C=[[1]], state_periods=p, Q=1, R=1), None, HUGE))
@example(refused(lambda p: LinearModel([[1]], C=[[1]], state_periods=p, Q=1, R=1), None, MASKED))
@example(refused(lambda values: glr_of_mean(values, [1], 1e-3), [1.0], [1e200]))
@example(refused(lambda records: tune(float, {"a": (1, 2)}, records, float), [1.0], np.array(1.0)))
@example(
    refused(lambda x: normal_form_observer(["-a"], ["a"], ["a"], gain=x, **KNOWN), "series", 1)
)
def test_arguments_of_any_kind_are_taken_or_refused(odd: Odd) -> None:
    check(*odd)


def test_every_public_name_has_a_call() -> None:
    called = {name.partition(",")[0].rpartition(".")[2] for name in calls()}
    results = {"DivergenceError", "Estimate", "InputError", "Run"}  # not constructed by users
    assert set(reobserve.__all__) - called - results == set()
