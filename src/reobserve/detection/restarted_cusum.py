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
from reobserve.observers.gaussian_filter import KalmanState
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.linear_filter_loop import Size, correct, new_work, predict
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
    found: Array = _restarted(
        (0,) * n, (0,) * m, *arrays, for_loop(y), for_loop(u), mean.copy(), covariance.copy()
    )
    return found


@kernel
def _restarted(
    states: Size,
    outputs: Size,
    healthy: ModelArrays,
    faulty: ModelArrays,
    measurements: Array,
    inputs: Array,
    mean: Array,
    covariance: Array,
) -> Array:
    n, m = len(states), len(outputs)
    statistic, g = np.empty(len(measurements)), 0.0
    work, factor, none = new_work(n, m), np.empty((m, m)), np.empty(0)
    error, innovation = np.zeros(m), np.empty(m)
    other, spread = mean.copy(), covariance.copy()
    for k in range(len(measurements)):
        if k > 0:
            predict(states, healthy, inputs[k - 1], mean, covariance, mean, covariance, work)
            predict(states, faulty, inputs[k - 1], other, spread, other, spread, work)
        ratio = correct(
            states, outputs, faulty, None, none, measurements[k], inputs[k],
            other, spread, error, innovation, factor, work,
        ) - correct(
            states, outputs, healthy, None, none, measurements[k], inputs[k],
            mean, covariance, error, innovation, factor, work,
        )  # fmt: skip
        g = max(0.0, g + ratio)
        statistic[k] = g
        if g == 0.0:
            for a in range(n):
                other[a] = mean[a]
                for b in range(n):
                    spread[a, b] = covariance[a, b]
    return statistic
