"""The linear error system of the extended observer, and what the proof of Theorem 2 asks of rho."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_lyapunov

from reobserve.papers.delay.setup import build_model
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.replication.metrics.responses import window
from reobserve.replication.parameters.job import Job
from reobserve.signals.series import Series
from reobserve.synthesis.high_gain import high_gain, lyapunov_matrix

Array = NDArray[np.float64]

FIGURES = ("order2", "order2_noise")  # the observers of Figs 1 and 2


@part
def measure(job: Job, ramp: Series, sine: Series) -> Iterator[Metric]:
    """Poles, the lag behind a varying delay, noise in the delay, and the rho that is proved."""
    stiffness, friction, gain = build_model(job.plant, "pendulum").parameters
    for name in FIGURES:
        rho = job.observers[name].rho
        for when, turn in (("", 1.0), ("_upright", -1.0)):
            poles = np.linalg.eigvals(error_matrix(rho, turn * stiffness, friction))
            yield Metric(name, f"slow_pole{when}", float(np.max(poles.real)), "1/s")
        proved = least_proved_rho(stiffness, friction)
        yield Metric(name, "rho_over_proved", rho / proved, "1")
    chosen = window(ramp.time, *job.metrics.varying)
    slope = np.gradient(ramp["delay"], ramp.time)
    for rho in job.theory.rhos:
        turn = stiffness * np.cos(ramp["state"][:, 0])
        lag = lag_per_rate(rho, turn, friction) * slope
        peak = float(np.max(np.abs(lag[chosen])))
        yield Metric.at("order2", ("predicted_peak_delay_error", peak, "s"), rho=rho)
    xi = gain * float(np.max(np.abs(sine["input_derivatives"][:, 0])))
    for rho in job.theory.rhos:
        period = job.plant.noise_period
        value = noise_gain(rho, stiffness, friction, xi, period)
        yield Metric.at("order2_noise", ("noise_gain", value, "s/rad"), rho=rho)


def error_matrix(rho: float, stiffness: float, friction: float) -> Array:
    """Of the errors of x1, x2 and xi tau, shape (3, 3), for a constant xi.

    Lechappe et al. 2018, (14).

    ``stiffness`` is g/l cos x1 [1/s^2], ``friction`` k/m [1/s].
    """
    matrix = np.eye(3, k=1)
    matrix[:, 0] -= high_gain(3, rho)
    matrix[1, :2] -= stiffness, friction
    return matrix


def lag_per_rate(rho: float, stiffness: Any, friction: float) -> Any:
    """The error of the delay over its rate [s], at rest: of the linear error system."""
    return -(3 * rho * friction + 3 * rho**2 + stiffness) / rho**3


def noise_gain(rho: float, stiffness: float, friction: float, xi: float, period: float) -> float:
    """Standard deviation of the delay over that of noise on y, held for a short ``period`` [s].

    The noise is taken as white with the density of a held one, which it is to an observer that is
    slower than it.
    """
    matrix, gains = error_matrix(rho, stiffness, friction), high_gain(3, rho)
    covariance = solve_continuous_lyapunov(matrix, -period * np.outer(gains, gains))
    return float(np.sqrt(covariance[2, 2]) / abs(xi))


def least_proved_rho(stiffness: float, friction: float) -> float:
    """The rho from which on c3 is above zero, with a constant xi, so that nu = 0.

    Lechappe et al. 2018, (24) and (31).

    rho delta_1 = 2 c1 ||S_1|| with c1 the norm of (24) at the hanging pendulum, taken for the rho
    itself: less than the constant of (25), which holds for all rho from 1 on.
    """
    spread = np.linalg.eigvalsh(lyapunov_matrix(3, 1.0))
    doubled = (2 * float(spread[-1] / spread[0])) ** 2
    half = 0.5 * doubled * friction**2
    return float(np.sqrt(half + np.sqrt(half**2 + doubled * stiffness**2)))
