"""The table of a study: its columns, and the names used in its rows."""

from __future__ import annotations

from reobserve.core.files import NAME, NUMBER, SCORE, UNIT, WHOLE

HEADER = ("observer", "sweep", "level", "run", "quantity", "value", "unit")
KINDS = {
    **dict.fromkeys(("observer", "sweep", "quantity"), NAME),
    "level": NUMBER, "run": WHOLE, "value": SCORE, "unit": UNIT,
}  # fmt: skip

# Neighbourhood: the tuned numbers.
STATES, OUTPUTS = 5, 3
TUNED = (
    *(f"process_noise_{i + 1}" for i in range(STATES)),
    *(f"measurement_noise_{i + 1}" for i in range(OUTPUTS)),
    "leave",
)

# Causes: variants, and whether the scale of the layers, in the column of runs, is that of the
# parameter file or of the study.
INTACT, KALMAN, FROZEN, ZERO_RATE = "whole", "kalman", "frozen", "zero_rate"
WEIGHTED = "weighted"  # frozen at the effective gains
STATED, SCANNED = 0, 1
