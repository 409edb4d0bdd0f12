"""Observers judged over a grid of initial states, all of them from one and the same estimate.

All runs are compiled: a plant and an observer over twenty seconds take some milliseconds.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import DivergenceError
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.normal_form_observer import NormalFormObserver
from reobserve.papers.lie.scoring import integral_of_squares, settling_time
from reobserve.plants.polynomial import PolynomialPlant

Array = NDArray[np.float64]


class Outcome(NamedTuple):
    """Of one run: the integral of |x^ - x|^2 [s] and when e settles [s]; nan if never."""

    ise: float
    settling_time: float
    diverged: bool

    @property
    def settled(self) -> bool:
        """Whether e settles within the run."""
        return bool(np.isfinite(self.settling_time))


@dataclass(frozen=True, eq=False)
class Record:
    """The plant from one initial state: its states and outputs in halves of a ``step`` [s]."""

    start: Array
    states: Array
    output: Array
    step: float

    def outcome(self, observer: NormalFormObserver, estimate: ArrayLike, band: float) -> Outcome:
        """How an observer does that starts from ``estimate``; it settles into ``band``."""
        state = observer.init(estimate)
        run = run_on_halves(observer, self.output, state=state, on_divergence="return")
        if run.diverged_at is not None:
            return Outcome(float("nan"), float("nan"), diverged=True)
        error = run["state"] - self.states[::2]
        squares = float(integral_of_squares(error, self.step).sum())
        return Outcome(squares, settling_time(error, self.step, band), diverged=False)


def records(
    plant: PolynomialPlant, axis: Array, estimate: ArrayLike, steps: int, step: float
) -> Iterator[Record]:
    """The plant from all states whose coordinates are on ``axis``, but for the estimate itself.

    Raises
    ------
    DivergenceError
        If the plant leaves the range of floating-point numbers from one of them.
    """
    for point in product(axis, repeat=plant.system.states):
        start = np.array(point)
        if np.array_equal(start, estimate):
            continue  # no error to begin with
        try:
            states = plant.simulate(start, 0.5 * step, 2 * steps)
        except DivergenceError as problem:
            raise DivergenceError(f"plant from {point}", problem.time) from None
        yield Record(start, states, plant.output(states), step)


def axis(half_width: float, points: int) -> Array:
    """So many numbers from -``half_width`` to ``half_width``."""
    found = np.linspace(-1.0, 1.0, points)
    found *= half_width
    return found
