"""Records sampled twice a period, passed to an observer sample by sample."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.observers.run import Estimate

Array = NDArray[np.float64]


def stepped(
    observer: Any,
    state: Any,
    y: Array,
    u: Array | None = None,
    y_before: Array | None = None,
    u_before: Array | None = None,
) -> tuple[Any, list[Estimate]]:
    """The input of `run_on_halves`, by one call of `step` per sample."""
    found = []
    left = y if y_before is None else y_before, u if u_before is None else u_before
    for k in range(0, len(y), 2):
        known = None if u is None else u[k]
        middle = y[max(k - 1, 0)], None if u is None else u[max(k - 1, 0)]
        before = left[0][k], None if left[1] is None else left[1][k]
        state, estimate = observer.step(state, y[k], known, before=before, middle=middle)
        found.append(estimate)
    return state, found


def rows_of(found: list[Estimate], name: str) -> Array:
    """One estimate at all samples."""
    return np.array([estimate[name] for estimate in found])
