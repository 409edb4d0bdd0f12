"""The columns of the table of a study, and what their cells must be."""

from __future__ import annotations

from reobserve.core.files import NAME, NUMBER, SCORE, WHOLE

HEADER = ("sweep", "observer", "level", "run", "relative_rms_error")
KINDS = {
    **dict.fromkeys(("sweep", "observer"), NAME),
    "level": NUMBER, "run": WHOLE, "relative_rms_error": SCORE,
}  # fmt: skip
