"""Measured signals in the plant's record."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve_papers.signals.series import Series

Pair = tuple[NDArray[np.float64], NDArray[np.float64]]


def measured(plant: Series, name: str, clean: str) -> Pair:
    """A measured channel and its limits from the left, or the clean one if there is no noise."""
    if name in plant.channels:
        return plant[name], plant[f"{name}_before"]
    values = plant[clean] if plant[clean].ndim == 1 else np.ascontiguousarray(plant[clean][:, 0])
    return values, values


def output(plant: Series) -> Pair:
    """The measured y and its limits from the left."""
    return measured(plant, "measured", "state")
