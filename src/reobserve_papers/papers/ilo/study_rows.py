"""Columns of the table of a study, and the kinds of their cells."""

from __future__ import annotations

from reobserve.core.files import NAME, NUMBER, SCORE, WHOLE

KINDS = {
    **dict.fromkeys(("sweep", "observer"), NAME),
    "level": NUMBER, "run": WHOLE, "relative_rms_error": SCORE,
}  # fmt: skip
HEADER = tuple(KINDS)
