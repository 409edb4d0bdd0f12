"""Differential evolution in the unit cube within a budget, and its first points."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Batch = Callable[[Iterable[Array]], list[float]]

FIRST = 16  # points of Sobol's sequence


class SpentError(Exception):
    """The budget is spent."""


def search(batch: Batch, dimension: int, budget: int, seed: int) -> None:
    """Search the unit cube for the minimum, or raise `SpentError` after ``budget`` evaluations."""
    from scipy.optimize import differential_evolution

    left = budget
    raised: Exception | None = None

    def generation(_: Any, points: Iterable[Array]) -> list[float]:
        nonlocal left, raised
        points = list(points)
        try:
            values = batch(points[:left])
        except Exception as error:
            raised = error
            raise
        left -= len(values)
        if not left:
            raise SpentError
        return values

    try:
        differential_evolution(
            lambda _: math.nan,  # scipy hands the points to ``workers``
            [(0.0, 1.0)] * dimension, init=sobol(dimension, seed), maxiter=budget,
            seed=np.random.Generator(np.random.PCG64(seed)), updating="deferred",
            workers=generation, polish=False, tol=0.0,
        )  # fmt: skip
    except Exception as error:  # scipy replaces a ValueError or a TypeError by its own
        raise raised or error from None


def sobol(dimension: int, seed: int) -> Array:
    """The first points of Sobol's sequence, scrambled by the seed, shape (16, dimension)."""
    from scipy.stats.qmc import Sobol

    sequence: Any = Sobol(dimension, rng=np.random.Generator(np.random.PCG64(seed)))
    points: Array = sequence.random(FIRST)
    return points
