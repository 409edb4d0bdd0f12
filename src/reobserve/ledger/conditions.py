"""Conditions on values of a ledger, put beside a type in `Annotated`.

See `reobserve.plain_data.typed_tree`. Each makes a function of a dotted key and a value that raises
`InputError` with both.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from reobserve.errors import InputError, shown
from reobserve.numerics.matrices import as_floats, as_matrix, as_positive_definite, as_vector
from reobserve.timeseries.signals import Signal

Condition = Callable[[str, Any], None]


def above(least: float) -> Condition:
    """Greater than ``least``."""

    def check(place: str, value: float) -> None:
        if not value > least:
            raise InputError(place, f"{value:g} must be greater than {least or 'zero'}")

    return check


def between(low: float, high: float) -> Condition:
    """Strictly between two numbers."""

    def check(place: str, value: float) -> None:
        if not low < value < high:
            raise InputError(place, f"{value:g} must be between {low:g} and {high:g}")

    return check


def within(low: float, high: float) -> Condition:
    """From one number to another, both included."""

    def check(place: str, value: float) -> None:
        if not low <= value <= high:
            raise InputError(place, f"{value:g} must be from {low} to {high}")

    return check


def not_negative(place: str, value: float) -> None:
    """Zero or more."""
    if value < 0:
        raise InputError(place, f"{value:g} must not be negative")


def items(least: int = 1, most: int = 10_000) -> Condition:
    """A list of so many."""

    def check(place: str, value: list[Any]) -> None:
        if not least <= len(value) <= most:
            raise InputError(place, f"has {len(value)} items, must have {least} to {most}")

    return check


def distinct(place: str, value: list[Any]) -> None:
    """A list that names nothing twice."""
    if len(set(value)) < len(value):
        raise InputError(place, f"{shown(value)} must not name anything twice")


def rising(place: str, value: list[float]) -> None:
    """Two numbers from zero on, the second one greater."""
    first, last = as_vector(place, value, 2)
    if not 0 <= first < last:
        raise InputError(place, f"[{first:g}, {last:g}] must be 0 or more, rising")


def vector(size: int) -> Condition:
    """A list of ``size`` numbers."""

    def check(place: str, value: Any) -> None:
        as_vector(place, value, size)

    return check


def array(*shape: int) -> Condition:
    """Lists of lists of numbers, as many as ``shape`` says."""

    def check(place: str, value: Any) -> None:
        found = as_floats(place, value).shape
        if found != shape:
            raise InputError(place, f"has shape {found}, must be {shape}")

    return check


def matrix(size: int) -> Condition:
    """A number (times the identity), a diagonal or a square matrix."""

    def check(place: str, value: Any) -> None:
        as_matrix(place, value, size)

    return check


def positive_definite(size: int) -> Condition:
    """The same, and symmetric positive definite."""

    def check(place: str, value: Any) -> None:
        as_positive_definite(place, value, size)

    return check


def signal(axes: int) -> Condition:
    """The terms of a signal, see `reobserve.timeseries.signals`."""

    def check(place: str, value: Any) -> None:
        Signal.parse(place, value, axes)

    return check


Positive = Annotated[float, above(0.0)]
NotNegative = Annotated[float, not_negative]
Share = Annotated[float, between(0.0, 1.0)]
Count = Annotated[int, within(1, 1_000_000)]
Seed = Annotated[int, not_negative]
Levels = Annotated[list[Positive], items()]  # what a study or a figure goes through
Window = Annotated[list[float], rising]  # from one time to another
Names = Annotated[list[str], items(), distinct]
Terms = list[dict[str, Any]]  # of a signal or a polynomial, which have conditions of their own
