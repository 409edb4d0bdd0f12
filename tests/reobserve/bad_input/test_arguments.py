"""Arguments of the library's public classes and functions: other types, shapes and numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import datetime
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reobserve
from reobserve.core.errors import InputError
from reobserve.observers.fixed_gain import luenberger
from reobserve.synthesis.high_gain_design import high_gain_over_time
from reobserve.synthesis.ilo_certificate import certify
from reobserve.synthesis.linear_gain import place, steady_kalman_gain, unobservable_modes
from reobserve.systems.linear import LinearModel
from tests.reobserve.library.calls import Call, calls
from tests.reobserve.library.calls.models import linear_model

from .outcome import is_accepted


class NoArray:
    def __array__(self, *_: Any, **__: Any) -> Any:
        raise RuntimeError("no array")


class NoRepr:
    def __repr__(self) -> str:
        raise RuntimeError("no repr")


# Objects of other types, by name; functions derive one from the valid argument.
THINGS: dict[str, Callable[[Any], Any]] = {
    "nothing": lambda _: None, "text": lambda _: "text", "empty text": lambda _: "",
    "long text": lambda _: "x" * 20_000, "bytes": lambda _: b"1", "true": lambda _: True,
    "false": lambda _: False, "an object": lambda _: object(), "a type": lambda _: float,
    "a set": lambda _: {1.0}, "a dictionary": lambda _: {"a": 1}, "a module": lambda _: np,
    "a function": lambda _: lambda *_: 0.0, "a generator": lambda _: (k for k in range(3)),
    "an empty tuple": lambda _: (), "an empty list": lambda _: [], "texts": lambda _: ["1", "2"],
    "a deep list": lambda _: [[[[1.0]]]], "rows of two lengths": lambda _: [[1.0], []],
    "a list with nothing": lambda _: [None], "objects": lambda _: [object()],
    "a date": lambda _: datetime(2020, 1, 1), "an exception": lambda _: ValueError("x"),
    "a list of it": lambda one: [one], "a pair of it": lambda one: (one, one),
    "no array": lambda _: NoArray(), "no repr": lambda _: NoRepr(),
}  # fmt: skip
NUMBERS = [
    0, -0.0, 1, -1, 2, 1.5, 1e-300, 1e300, -1e300, 5e-324, 2**31, 2**63, 2**70, 10**400,
    np.float32(0.1), np.int8(1), np.uint64(2**63), np.float16(1), np.longdouble("1e400"),
    Fraction(1, 3), Decimal("0.1"), np.array(1.0), np.array([1.0]), float("inf"), -float("inf"),
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
    at %= max(array.size, 1)
    mask = np.arange(array.size).reshape(array.shape) == at
    frozen = array.copy()
    frozen.flags.writeable = False
    return {
        "not a number": lambda: np.where(mask, np.nan, array),
        "infinite": lambda: np.where(mask, np.inf, array),
        "huge": lambda: np.where(mask, 1e308, array),
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
        "booleans": lambda: array > 0,
        "short": lambda: array.astype(np.float32),
        "long": lambda: array.astype(np.longdouble),
        "integers": lambda: array.astype(np.int64),
        "a masked entry": lambda: np.ma.masked_array(array, mask),
        "a mask of nothing": lambda: np.ma.masked_array(array, np.zeros(array.shape, bool)),
        "read-only": lambda: frozen,
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
    }


def is_numeric(valid: Any) -> bool:
    if isinstance(valid, bool | str) or valid is None:
        return False
    try:
        return np.asarray(valid).dtype.kind in "iuf"
    except Exception:
        return False


@st.composite
def odd_argument(draw: st.DrawFn, valid: Any) -> tuple[str, Any]:
    """A replacement for a valid argument, and its name."""
    which = draw(st.sampled_from(["thing", "number", "array", "array", "array"]))
    if which == "thing" or not is_numeric(valid):
        name = draw(st.sampled_from(list(THINGS)))
        return name, THINGS[name](valid)
    if which == "number":
        return draw(
            st.sampled_from([("a number", number) for number in NUMBERS])
            | st.sampled_from([(name, one) for name, odd in NEVER.items() for one in odd])
        )
    made = arrays(valid, draw(st.integers(0, 50)))
    name = draw(st.sampled_from(list(made)))
    return name, made[name]()


def check_odd_arguments(data: st.DataObject, every: Mapping[str, Call]) -> None:
    """Make one of the calls with one or two odd arguments."""
    call: Call = data.draw(st.sampled_from([one for one in every.values() if one.arguments]))
    arguments = [one.copy() if type(one) is np.ndarray else one for one in call.arguments]
    never = False
    places = st.integers(0, len(arguments) - 1)
    for at in data.draw(st.lists(places, min_size=1, max_size=2, unique=True)):
        name, arguments[at] = data.draw(odd_argument(call.arguments[at]))
        numeric = is_numeric(call.arguments[at])
        never = never or (numeric and name in NEVER and name not in call.takes)
    accepted = is_accepted(lambda: call.function(*arguments))
    assert not (accepted and never), "took for a number what is none"


@settings(max_examples=8 * settings().max_examples)
@given(st.data())
def test_arguments_of_odd_type_shape_or_value_are_accepted_or_refused(data: st.DataObject) -> None:
    check_odd_arguments(data, calls())


@pytest.mark.nightly_cases("synthesis.extended_state.pd_pi.design")
@pytest.mark.parametrize("call", calls().values(), ids=list(calls()))
def test_every_number_may_be_huge(call: Call) -> None:
    for at, valid in enumerate(call.arguments):
        if is_numeric(valid) and np.ndim(valid) == 0:
            for huge in (2**31, 2**63 - 1, 2**63, 2**64, 10**400, -(2**63), -(2**64)):
                given = [one.copy() if type(one) is np.ndarray else one for one in call.arguments]
                given[at] = huge
                is_accepted(lambda given=given: call.function(*given))


def test_every_public_name_has_a_call() -> None:
    called = {name.partition(",")[0].rpartition(".")[2] for name in calls()}
    results = {"DivergenceError", "Estimate", "InputError", "Run"}  # not constructed by users
    assert set(reobserve.__all__) - called - results == set()


HUGE = [[1e308, 1e308], [1e308, 1e308]]
STIFF = LinearModel([[1e300, 1.0], [0.0, 1e-300]], [[0.0], [1.0]], [[1.0, 0.0]], Q=1e-4, R=1e-2)
REFUSED: dict[str, Callable[[], object]] = {
    "poles: far from the eigenvalues": lambda: luenberger(linear_model(), [1e150, 2e150]),
    "poles: near the largest number": lambda: luenberger(linear_model(), [5e299, 6e299]),
    "poles: of both signs": lambda: luenberger(linear_model(), [1e308, -1e308]),
    "A, C: of huge matrices": lambda: unobservable_modes(HUGE, [[1.0, 0.0]]),
    "A, C: of huge matrices, placed": lambda: place(HUGE, [[1.0, 0.0]], [0.5, 0.6]),
    "model: of eigenvalues far apart": lambda: steady_kalman_gain(STIFF),
    "rho: so small that S is singular": lambda: high_gain_over_time(2, 1e-300, 1.0, [0.0]),
    "size: whose factorial is no number": lambda: high_gain_over_time(200, 1.0, 1.0, [0.0]),
    "observer_gain: huge": lambda: certify(1e308, np.eye(3), 0.5, 50.0, 0.01),
    "observer_gain: huge, full": lambda: certify(
        np.full((3, 3), 1e308), np.eye(3), 0.5, 50.0, 0.01
    ),
}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("case", REFUSED)
def test_values_that_once_raised_other_errors_are_refused(case: str) -> None:
    with pytest.raises(InputError, match=f"^{case.partition(':')[0]}: "):
        REFUSED[case]()
