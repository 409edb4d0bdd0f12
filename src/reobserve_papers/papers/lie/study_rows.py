"""The columns of the table of a study, and the kinds of their cells."""

from __future__ import annotations

from typing import NamedTuple

from reobserve.core.files import GAP, NAME, SCORE, UNIT, WHOLE


class Row(NamedTuple):
    """A number by form (or observer, or series), order or degree, and state."""

    form: str
    order: int
    x1: float | str
    x2: float | str
    quantity: str
    value: float
    unit: str


HEADER = Row._fields
KINDS = {
    "form": NAME, "order": WHOLE, "x1": GAP, "x2": GAP,
    "quantity": NAME, "value": SCORE, "unit": UNIT,
}  # fmt: skip


def summary(form: str, order: int, quantity: str, value: float, unit: str) -> Row:
    """A number that belongs to no single state."""
    return Row(form, order, "", "", quantity, float(value), unit)
