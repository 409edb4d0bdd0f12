"""Columns of the table of a study, and the kinds of their cells."""

from __future__ import annotations

from reobserve.core.files import NAME, NUMBER, SCORE, UNIT, WHOLE

HEADER = ("observer", "sweep", "level", "run", "quantity", "value", "unit")
KINDS = {
    **dict.fromkeys(("observer", "sweep", "quantity"), NAME),
    "level": NUMBER, "run": WHOLE, "value": SCORE, "unit": UNIT,
}  # fmt: skip
