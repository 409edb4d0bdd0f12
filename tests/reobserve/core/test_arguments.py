"""Checks of arguments that are no numbers, each at its limit and just beyond."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reobserve.core.arguments import as_flag, as_function, as_kind, as_poles, as_whole, as_word
from reobserve.core.errors import InputError
from reobserve.core.finite import finite
from reobserve.core.units import is_unit


@pytest.mark.parametrize(("value", "most"), [(2, 2**31), (2, 2), (np.int64(5), 5)])
def test_whole_number_in_the_range_is_accepted(value: Any, most: int) -> None:
    found = as_whole("it", value, 2, most)
    assert found == value
    assert type(found) is int


@pytest.mark.parametrize(
    ("value", "most", "said"),
    [
        (1, 2**31, "1 must be a whole number, 2 or more"),
        (1, 5, "1 must be a whole number, from 2 to 5"),
        (6, 5, "6 must be a whole number, from 2 to 5"),
        (3.0, 5, "3.0 must be a whole number, from 2 to 5"),
        (True, 2**31, "True must be a whole number, 2 or more"),
    ],
)
def test_other_number_is_refused(value: Any, most: int, said: str) -> None:
    with pytest.raises(InputError, match=f"^it: {said}"):
        as_whole("it", value, 2, most)


def test_counts_have_a_limit() -> None:
    assert as_whole("it", 2**31, 1) == 2**31
    for value in (2**31 + 1, np.uint64(2**64 - 1), 10**400):
        with pytest.raises(InputError, match=r"^it: .+ whole number, from 1 to 2147483648$"):
            as_whole("it", value, 1)


def test_words_flags_kinds_and_functions_are_checked() -> None:
    assert as_word("it", "b", ("a", "b")) == "b"
    assert as_flag("it", np.bool_(True)) is True
    assert as_flag("it", False) is False
    assert as_kind("it", 1, int) == 1
    for check, value, said in (
        (lambda v: as_word("it", v, ("a", "b")), "c", "'c' must be one of a, b"),
        (lambda v: as_word("it", v, ("a", "b")), ["a"], r"\['a'\] must be one of a, b"),
        (lambda v: as_flag("it", v), 1, "1 must be True or False"),
        (lambda v: as_kind("it", v, int), "1", "'1' must be of type int"),
        (lambda v: as_function("it", v), lambda t: t, "must be a signal, or a function"),
        (lambda v: as_function("it", v), float, "must be a signal, or a function"),
    ):
        with pytest.raises(InputError, match=said):
            check(value)
    assert as_function("it", abs_before) is abs_before


def abs_before(t: float, before: bool = False) -> float:
    return abs(t)


def test_poles_are_a_list_of_complex_numbers() -> None:
    assert np.array_equal(as_poles("it", [-1, -2 + 1j]), np.array([-1, -2 + 1j]))
    for value in ([[1.0]], ["-1"], 1.0, [1, [2]], np.ma.masked_array([1.0], [True])):
        with pytest.raises(InputError, match="must be a list of numbers"):
            as_poles("it", value)


@pytest.mark.parametrize("found", [np.inf, np.array([1.0, np.nan]), (1.0, np.array([-np.inf]))])
def test_result_that_is_not_finite_is_refused(found: Any) -> None:
    with pytest.raises(InputError, match=r"^rho: must keep results inside the range of floating"):
        finite("rho")(lambda: found)()
    assert finite("rho")(lambda: (1.0, np.ones(2)))()[0] == 1.0


@pytest.mark.parametrize(
    ("text", "known"),
    [
        ("1", True), ("N m s/rad", True), ("1/(A s^2)", True), ("m/s^-12", True), ("°C", True),
        ("rad, rad/s", True), (" ".join(["m"] * 8), True), (", ".join(["m"] * 66), True),
        ("m/s/s", True), ("mbar, kΩ", True), ("dB", True), ("y/s", True),
        ("", False), ("m^1234", False), ("rad,rad", False), (" ".join(["m"] * 31), False),
        (", ".join(["m"] * 68), False), ("m^٣", False), ("metro", False), ("m s/kg m", False),
    ],
)  # fmt: skip
def test_units_are_products_and_quotients_of_symbols(text: str, known: bool) -> None:
    assert is_unit(text) is known
