"""The table of a study: its columns, and the names used in its rows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from reobserve.core.files import NAME, NUMBER, SCORE, UNIT, WHOLE
from reobserve.papers.imm import keys

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
STATED, SCANNED = 0, 1

# Closeness: detectors besides the banks, and plants without process noise or with the Q of the
# filters.
UNMIXED, CUSUM, GLR = "unmixed", "cusum", "glr"
EXACT, DRIVEN = "exact", "driven"


def sweep_name(kind: str, level: float) -> str:
    """The name of a plant's noise in the study's table."""
    return f"{kind}_{level:g}"


def sweep_kind(sweep: str) -> tuple[str, float]:
    """The kind and level that `sweep_name` was given."""
    kind, _, level = sweep.partition("_")
    return kind, float(level)


def with_scales(
    observers: Mapping[str, keys.Observer], scales: list[float]
) -> dict[str, keys.Observer]:
    """The observers, and the first SVSF with its boundary layers at other scales."""
    more: dict[str, keys.Observer] = dict(observers)
    for name, body in observers.items():
        if isinstance(body, keys.SmoothVariableStructure):
            for scale in scales:
                more[f"{name}_scale_{scale:g}"] = replace(body, layer_scale=scale)
            break
    return more
