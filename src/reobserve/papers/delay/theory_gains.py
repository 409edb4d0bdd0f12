"""The linear error system of the extended observer."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.papers.delay.setup import build_model
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.replication.metrics.responses import window
from reobserve.replication.parameters.job import Job
from reobserve.signals.series import Series
from reobserve.synthesis.high_gain import high_gain

Array = NDArray[np.float64]

FIGURES = ("order2", "order2_noise")  # the observers of Figs 1 and 2


@part
def measure(job: Job, ramp: Series) -> Iterator[Metric]:
    """Poles, and the lag behind a varying delay."""
    g_over_l, friction, _ = build_model(job.plant, "pendulum").parameters
    for name in FIGURES:
        rho = job.observers[name].rho
        for when, turn in (("", 1.0), ("_upright", -1.0)):
            poles = np.linalg.eigvals(error_matrix(rho, turn * g_over_l, friction))
            yield Metric(name, f"slow_pole{when}", float(np.max(poles.real)), "1/s")
    chosen = window(ramp.time, *job.metrics.radius)
    slope = np.gradient(ramp["delay"], ramp.time)
    for rho in job.theory.rhos:
        turn = g_over_l * np.cos(ramp["state"][:, 0])
        lag = steady_ramp_error(rho, turn, friction) * slope
        peak = float(np.max(np.abs(lag[chosen])))
        yield Metric.at("order2", ("predicted_delay_radius", peak, "s"), rho=rho)


def error_matrix(rho: float, g_over_l: float, friction: float) -> Array:
    """Of the errors of x1, x2 and xi tau, shape (3, 3), for a constant xi.

    Lechappe et al. 2018, (14).

    ``g_over_l`` is g/l cos x1 [1/s^2], ``friction`` k/m [1/s].
    """
    matrix = np.eye(3, k=1)
    matrix[:, 0] -= high_gain(3, rho)
    matrix[1, :2] -= g_over_l, friction
    return matrix


def steady_ramp_error(rho: float, g_over_l: Any, friction: float) -> Any:
    """The error of the delay over its rate [s], at rest: of the linear error system."""
    return -(3 * rho * friction + 3 * rho**2 + g_over_l) / rho**3
