"""Functions are equal while numba would compile the same code from them."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numba import njit

from reobserve.core.frozen_function import FrozenFunction

GAIN: Any = 2.0
MODULE = ModuleType("constants")
MODULE.gain = 2.0  # type: ignore[attr-defined]


def helper(x: Any) -> Any:
    return GAIN * x


jitted = njit(helper)


def reads_global(x: Any) -> Any:
    return GAIN * x


def reads_in_nested_function(x: Any) -> Any:
    def inner(y: Any) -> Any:
        return GAIN * y

    return inner(x)


def reads_module(x: Any) -> Any:
    return MODULE.gain * x


def calls_helper(x: Any) -> Any:
    return helper(x)


def calls_jitted(x: Any) -> Any:
    return jitted(x)


def calls_itself(x: Any) -> Any:
    return calls_itself(x - GAIN) if x > 0 else x


def with_defaults(x: Any, gain: Any = 2.0, *, shift: Any = 1.0) -> Any:
    return gain * x + shift


READERS = [reads_global, reads_in_nested_function, calls_helper, calls_jitted, calls_itself]


def closed_over(value: Any) -> Callable[..., Any]:
    return lambda x: value * x


@pytest.mark.parametrize("function", READERS)
def test_value_of_a_global_counts_also_where_another_function_names_it(
    function: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = FrozenFunction(function)
    assert before == FrozenFunction(function)
    assert hash(before) == hash(FrozenFunction(function))
    monkeypatch.setitem(globals(), "GAIN", 3.0)
    assert before != FrozenFunction(function)
    monkeypatch.setitem(globals(), "GAIN", float("2"))  # another object of the same value
    assert before == FrozenFunction(function)


def test_attribute_of_a_module_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    before = FrozenFunction(reads_module)
    monkeypatch.setattr(MODULE, "other", 1.0, raising=False)
    assert before == FrozenFunction(reads_module)
    monkeypatch.setattr(MODULE, "gain", 3.0)
    assert before != FrozenFunction(reads_module)


def test_defaults_count(monkeypatch: pytest.MonkeyPatch) -> None:
    before = FrozenFunction(with_defaults)
    monkeypatch.setattr(with_defaults, "__kwdefaults__", {"shift": 2.0})
    assert before != FrozenFunction(with_defaults)
    monkeypatch.undo()
    monkeypatch.setattr(with_defaults, "__defaults__", (3.0,))
    assert before != FrozenFunction(with_defaults)
    monkeypatch.undo()
    assert before == FrozenFunction(with_defaults)


def test_array_counts_by_what_it_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    array = np.arange(4.0).reshape(2, 2)
    monkeypatch.setitem(globals(), "GAIN", array)
    before = FrozenFunction(reads_global)
    monkeypatch.setitem(globals(), "GAIN", array.copy())
    assert before == FrozenFunction(reads_global)
    for other in (array.copy("F"), array.astype(np.float32), array.ravel()):
        monkeypatch.setitem(globals(), "GAIN", other)
        assert before != FrozenFunction(reads_global)
    array[0, 0] = 7.0
    monkeypatch.setitem(globals(), "GAIN", array)
    assert before != FrozenFunction(reads_global)


@pytest.mark.parametrize("array", [np.zeros(200_000), np.zeros((4, 4))[:, ::2]])
def test_array_of_which_numba_compiles_the_address_counts_by_identity(array: Any) -> None:
    assert FrozenFunction(closed_over(array)) == FrozenFunction(closed_over(array))
    copy = np.zeros((4, 4))[:, ::2] if array.ndim == 2 else array.copy()
    assert FrozenFunction(closed_over(array)) != FrozenFunction(closed_over(copy))


SAME = [
    (float("nan"), float("nan")),
    ((10**5000,), (10**5000,)),  # too many digits to be shown
    ((1, "a", 2.5), (1, "a", 2.5)),
    (np.float32(1.5), np.float32(1.5)),
    (closed_over(1.0), closed_over(1.0)),
    (math, math),
]
DIFFERENT = [
    (1, 1.0),
    (1, True),
    (0.0, -0.0),
    (1.5, np.float64(1.5)),
    (np.float32(1.5), np.float64(1.5)),
    ((1, 2), (1, 2.0)),
    ([1.0], [1.0]),  # which numba refuses
    (closed_over(1.0), closed_over(2.0)),
    (math.sin, math.cos),
]


@pytest.mark.parametrize(("one", "other"), SAME)
def test_closures_over_the_same_value_are_equal(one: Any, other: Any) -> None:
    assert FrozenFunction(closed_over(one)) == FrozenFunction(closed_over(other))


@pytest.mark.parametrize(("one", "other"), DIFFERENT)
def test_closures_over_other_values_differ(one: Any, other: Any) -> None:
    assert FrozenFunction(closed_over(one)) != FrozenFunction(closed_over(other))


def test_two_functions_differ() -> None:
    assert FrozenFunction(reads_global) != FrozenFunction(reads_module)
    assert FrozenFunction(njit(reads_global)) != FrozenFunction(njit(reads_global))
    assert FrozenFunction(jitted) == FrozenFunction(jitted)


def test_very_long_chain_of_functions_equals_nothing() -> None:
    chain = closed_over(1.0)
    for _ in range(1000):
        chain = closed_over(chain)
    assert FrozenFunction(chain) != FrozenFunction(chain)


def empty_cell() -> Callable[..., Any]:
    def function(x: Any) -> Any:
        return later + x

    if GAIN == 0:
        later = 1.0
    return function


def test_cell_without_a_value_is_one_more_value() -> None:
    assert FrozenFunction(empty_cell()) == FrozenFunction(empty_cell())
