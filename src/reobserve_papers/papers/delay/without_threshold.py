"""The extended observer of Fig. 3 without a threshold, at the samples of its inputs.

With m = 2 the estimate itself moves xi^, possibly to zero, where the solution of (9) ends (see
`theory.small_threshold`). A sampled observer steps over that instant: its estimate is projected on
the interval of the delay after each step, so that it cannot diverge.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import allocating_kernel
from reobserve.synthesis.high_gain_design import high_gain
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.setup import build_model, delay_bounds
from reobserve_papers.signals.grid import stride
from reobserve_papers.signals.series import Channel, Series

Array = NDArray[np.float64]


def estimate(job: keys.Job, observer: keys.Extended, plant: Series) -> Series:
    """The estimates of the delay [s] of the scalar plant, by classical Runge-Kutta."""
    every = stride(job.plant.step, observer.sampling_period)
    rows = np.column_stack([plant["state"], plant["input"], plant["input_derivatives"]])[::every]
    values = np.empty((len(rows) // 2 + 1, 2))
    values[0] = [*observer.initial_estimate, observer.initial_delay]
    parameters = np.array([*build_model(job.plant, observer.model).parameters])
    bounds, step = np.array(delay_bounds(job.plant)), observer.sampling_period
    gains = high_gain(2, observer.rho)
    _fill(np.ascontiguousarray(rows), parameters, gains, bounds, step, values)
    delay = Channel(values[:, 1].copy(), "s")
    return Series(plant.time[:: 2 * every], {"delay": delay}, plant.events)


@allocating_kernel
def _fill(
    rows: Array, parameters: Array, gains: Array, bounds: Array, step: float, values: Array
) -> None:
    """Fill ``values`` (x^, tau^) from the first row, with y, u, u' and u'' at half steps."""
    decay, gain = parameters
    low, high = bounds
    slopes = np.empty((4, 2))
    for k in range(len(values) - 1):
        for stage in range(4):
            x, tau = values[k]
            if stage > 0:
                part = step if stage == 3 else 0.5 * step
                x += part * slopes[stage - 1, 0]
                tau = min(max(tau + part * slopes[stage - 1, 1], low), high)
            y, u, first, second = rows[2 * k + (stage + 1) // 2]
            xi = gain * (0.5 * tau * second - first)
            slopes[stage, 0] = -decay * x + gain * u + xi * tau - gains[0] * (x - y)
            slopes[stage, 1] = -gains[1] * (x - y) / xi if xi != 0.0 else 0.0
        mean = (slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3]) / 6
        values[k + 1, 0] = values[k, 0] + step * mean[0]
        values[k + 1, 1] = min(max(values[k, 1] + step * mean[1], low), high)
