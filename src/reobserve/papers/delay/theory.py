"""Stage theory: what the paper proves and says beside its figures, in numbers."""

from __future__ import annotations

from typing import Any

from reobserve.metrics import Metric
from reobserve.papers.delay import (
    theory_conditions,
    theory_derivatives,
    theory_gains,
    theory_runs,
)


def measure(settings: dict[str, Any], designs: dict[str, Any]) -> list[Metric]:
    """The numbers of the theory; see ``results/README.md`` for their names.

    Raises
    ------
    InputError
        If a setting cannot be used.
    DivergenceError
        If the plant or an observer diverges.
    """
    ramp, sine = (
        theory_runs.record(settings, settings["theory"][name]) for name in ("ramp", "sine")
    )
    away = theory_runs.near_and_away(settings, sine, sine.time)[1]
    return [
        *theory_conditions.measure(settings, ramp, sine),
        *theory_gains.measure(settings, ramp, sine),
        *theory_derivatives.measure(settings, sine, away),
        *theory_runs.measure(settings, ramp, sine),
    ]
