"""Columns of the table of a study, and the kinds of their cells."""

from __future__ import annotations

from reobserve.core.files import NAME, NUMBER, SCORE, UNIT

HEADER = ("kind", "filter_rate", "choice", "level", "quantity", "value", "unit")
KINDS = {
    **dict.fromkeys(("kind", "choice", "quantity"), NAME),
    "filter_rate": NUMBER, "level": NUMBER, "value": SCORE, "unit": UNIT,
}  # fmt: skip
