"""Base class of the delay estimators that Fig. 3 compares.

    x' = -a x + b u(t - tau(t)),    x known

is the plant of the comparison, with a = b = 1 (Lechappe et al. 2018, (39)). The paper cites these
estimators without printing them, and we had none of the cited papers. The modules that build on
this one are therefore reconstructions. Each states and derives its equations; its results need not
hold for the method that the paper used.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import DivergenceError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DelayEstimator(ABC):
    """An estimator of the delay of x' = -a x + b u(t - tau), which measures x and knows u and u'.

    Parameters
    ----------
    decay, input_gain
        a and b [1/s].
    delay_bounds
        [s], the minimum and the maximum delay, between which the estimate stays.
    sampling_period
        [s], also the integration step.
    """

    decay: float
    input_gain: float
    delay_bounds: tuple[float, float]
    sampling_period: float

    measurements: ClassVar[int] = 1  # x, or x and x'

    @abstractmethod
    def start(self, x: float, delay: float) -> Array:
        """The values of the algorithm before the first step, the estimate of the delay first."""

    @abstractmethod
    def _fill(self, output: Array, inputs: Array, first: int, rows: Array) -> int:
        """Fill ``rows`` from the first one, and return how many are finite."""

    def run(self, output: Array, past: Array, control: Array, start: Array) -> Array:
        """The values of the algorithm at the ends of steps, shape (k + 1, n).

        Parameters
        ----------
        output
            x, or x and x' [1/s], at both ends and in the middle of each step, shape (2 k + 1, 1 or
            2).
        past, control
            u and u' [1/s] at half steps, shapes (m, 2) and (2 k + 1, 2): over the maximum delay
            before the start, and from the start on.
        start
            The result of `start`.
        """
        inputs = np.ascontiguousarray(np.concatenate([past[:-1], control]))
        rows = np.empty((len(control) // 2 + 1, len(start)))
        rows[0] = start
        finite = self._fill(np.ascontiguousarray(output), inputs, len(past) - 1, rows)
        if finite < len(rows):
            raise DivergenceError(type(self).__name__, (finite - 1) * self.sampling_period)
        return rows
