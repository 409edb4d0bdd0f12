"""The exact scalar plant with a delayed input, and the input of its delay estimators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reobserve_papers.papers.delay.estimator import DelayEstimator
from reobserve_papers.papers.delay.estimator_adaptive import AdaptiveDelayEstimator
from reobserve_papers.papers.delay.estimator_least_squares import LeastSquaresDelayEstimator
from reobserve_papers.papers.delay.estimator_variable_structure import (
    VariableStructureDelayEstimator,
)

Array = NDArray[np.float64]
Delay = Callable[[Array], Array]

A, B = 1.3, -0.8
BOUNDS = (0.0, 1.5)
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


@dataclass(frozen=True)
class Input:
    """u and u' in closed form, also before the start: a sine, or a ramp with the same initial
    slope.
    """

    frequency: float = 0.2
    ramp: bool = False

    def __call__(self, time: Array | float) -> Array:
        t, w = np.asarray(time), self.frequency
        if self.ramp:
            return np.stack([w * t, np.full_like(t, w)], axis=-1)
        return np.stack([np.sin(w * t), w * np.cos(w * t)], axis=-1)


def paper_delay(t: Array) -> Array:
    late = 0.8 + 0.45 * np.sin(0.2 * t)
    return np.where(t < 20, 0.6, np.where(t < 40, 1.2, np.where(t < 60, 0.3, late)))


def short_delay(t: Array) -> Array:
    """Jumps at 3 and 6 s, then a sine."""
    return np.where(t < 3, 0.6, np.where(t < 6, 1.2, 0.8 + 0.4 * np.sin(0.9 * t)))


def constant(value: float) -> Delay:
    return lambda t: np.full_like(t, value)


def half_steps(step: float, end: float) -> Array:
    return 0.5 * step * np.arange(2 * round(end / step) + 1)


def plant(u: Input, delay: Delay, time: Array, a: float, b: float, x0: float = 0.0) -> Array:
    """x at the times, by the exponential and Gauss quadrature of order 16 between them."""
    step = np.diff(time)[:, None]
    nodes = time[:-1, None] + 0.5 * step * (1 + NODES)
    force = b * u(nodes - delay(nodes))[..., 0] * np.exp(-a * (time[1:, None] - nodes))
    gained = 0.5 * step[:, 0] * (force @ WEIGHTS)
    x = np.empty(len(time))
    x[0] = x0
    for i, (fade, more) in enumerate(zip(np.exp(-a * step[:, 0]), gained, strict=True)):
        x[i + 1] = fade * x[i] + more
    return x


def record(
    estimator: DelayEstimator, u: Input, delay: Delay, end: float, x0: float = 0.0
) -> tuple[Array, Array, Array]:
    """The estimator's input at half periods: the output, u and u', and the past of u and u'."""
    h, a, b = estimator.sampling_period, estimator.decay, estimator.input_gain
    time = half_steps(h, end)
    x = plant(u, delay, time, a, b, x0)
    columns = [x, b * u(time - delay(time))[:, 0] - a * x][: estimator.measurements]
    back = 0.5 * h * np.arange(-2 * int(np.ceil(BOUNDS[1] / h)), 1)
    return np.stack(columns, axis=1), u(time), u(back)


def observed(
    estimator: DelayEstimator, rows: tuple[Array, Array, Array], first: float = 0.3, x0: float = 0.0
) -> Array:
    """The estimates over `record`, from an initial estimate."""
    output, control, past = rows
    return estimator.run(output, past, control, estimator.start(x0, first))


def run(estimator: DelayEstimator, u: Input, delay: Delay, end: float, first: float = 0.3) -> Array:
    return observed(estimator, record(estimator, u, delay, end), first)


def least_squares(h: float, covariance: float, forgetting: float) -> LeastSquaresDelayEstimator:
    return LeastSquaresDelayEstimator(A, B, BOUNDS, h, covariance, forgetting)


def adaptive(h: float, k: float, forgetting: float, gain: float) -> AdaptiveDelayEstimator:
    return AdaptiveDelayEstimator(A, B, BOUNDS, h, k, forgetting, gain)


def relay(h: float, gain: float, on: str) -> VariableStructureDelayEstimator:
    return VariableStructureDelayEstimator(A, B, BOUNDS, h, gain, on)


FAST = Input(0.7)
SMOOTH: dict[str, Callable[[float], DelayEstimator]] = {
    "least squares": lambda h: least_squares(h, 2.0, 0.8),
    "adaptive": lambda h: adaptive(h, 0.1, 1.5, 5.0),
}
ALL: dict[str, Callable[[float], DelayEstimator]] = {
    **SMOOTH,
    "relay": lambda h: relay(h, 0.5, "delay"),
    "inverse": lambda h: relay(h, 0.5, "inverse"),
}
