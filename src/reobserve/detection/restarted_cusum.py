"""Page's cumulative sum of two filters, of which that of the faulty plant is restarted.

    g(k) = max(0, g(k-1) + ln p1(y(k)) - ln p0(y(k)))

A filter of another model that runs through a healthy record ends in a state that the plant is not
in, and needs its time to find the plant's when the fault comes. So whenever g is zero, which says
that the fault has not begun yet, it takes over the posterior of the healthy plant's filter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import kernel
from reobserve.core.value import for_loop
from reobserve.observers.gaussian_state import KalmanState
from reobserve.observers.kalman import KalmanFilter, LinearWork, correct, new_linear_work, predict
from reobserve.systems.linear import ModelArrays

Array = NDArray[np.float64]


def restarted_cusum(
    healthy: KalmanFilter, faulty: KalmanFilter, y: Array, u: Array, start: KalmanState
) -> Array:
    """The statistic g, shape (k,), of measurements, (k, m), and inputs, (k, p).

    ``start`` is the healthy filter's state at the first row, of which both begin. The states of
    both models must mean the same.
    """
    n, m = healthy.model.states, healthy.model.outputs
    mean, covariance = start.posterior.mean, start.posterior.covariance
    arrays = healthy.model.arrays, faulty.model.arrays
    statistic = np.empty(len(y))
    _restarted(
        *arrays, for_loop(y), for_loop(u), mean.copy(), covariance.copy(), mean.copy(),
        covariance.copy(), np.zeros(m), np.empty(m), new_linear_work(n, m), statistic,
    )  # fmt: skip
    return statistic


@kernel
def _restarted(
    healthy: ModelArrays,
    faulty: ModelArrays,
    measurements: Array,
    inputs: Array,
    mean: Array,
    covariance: Array,
    other: Array,
    spread: Array,
    error: Array,
    innovation: Array,
    work: LinearWork,
    statistic: Array,
) -> None:
    A, B, C, D, Q, R = healthy
    A1, B1, C1, D1, Q1, R1 = faulty
    g, large = 0.0, work.panel
    for k in range(len(measurements)):
        y, u = measurements[k], inputs[k]
        if k > 0:
            predict(A, B, Q, inputs[k - 1], mean, covariance, mean, covariance, work, large)
            predict(A1, B1, Q1, inputs[k - 1], other, spread, other, spread, work, large)
        # g = max(0, g + ln p1(y) - ln p0(y))
        ratio = correct(
            C1, D1, R1, error, 0.0, None, error, y, u, other, spread, error, innovation, work
        ) - correct(
            C, D, R, error, 0.0, None, error, y, u, mean, covariance, error, innovation, work
        )
        g = max(0.0, g + ratio)
        statistic[k] = g
        if g == 0.0:
            for a in range(len(mean)):
                other[a] = mean[a]
                for b in range(len(mean)):
                    spread[a, b] = covariance[a, b]
