"""The linear error system of the extended observer."""

from __future__ import annotations

from collections.abc import Iterator
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from reobserve.synthesis.high_gain_design import high_gain, lyapunov_matrix
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.responses import scored
from reobserve_papers.metrics.theory_parts import part
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.setup import build_model, delay_bounds, input_and_derivatives
from reobserve_papers.parameters.job import named
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]

_STATES = 100_000  # random ones
_LARGE_GAINS = (1600.0, 3200.0, 6400.0)  # far beyond what (31) needs

FIGURES = ("order2", "order2_noise")  # the observers of Figs 1 and 2
ORDERS = {1: "order1_noise", 2: "order2_noise"}  # those of Fig. 2, by m


def measure(job: keys.Job, ramp: Series) -> Iterator[Metric]:
    """Metrics: poles, the lag behind a varying delay, the radius of (16), and V at a bound."""
    yield from _poles_and_lag(job, ramp)
    yield from _radii(job, ramp)
    yield from _proof_radii(job, ramp)
    yield from _held()


@part
def _poles_and_lag(job: keys.Job, ramp: Series) -> Iterator[Metric]:
    g_over_l, friction, _ = build_model(job.plant, "pendulum").parameters
    for name in FIGURES:
        rho = named(job.observers, name, keys.Extended).rho
        for when, turn in (("", 1.0), ("_upright", -1.0)):
            poles = np.linalg.eigvals(error_matrix(rho, turn * g_over_l, friction))
            yield Metric(name, f"slow_pole{when}", float(np.max(poles.real)), "1/s")
    chosen = scored("metrics.radius", ramp.time, *job.metrics.radius)
    slope = np.gradient(ramp["delay"], ramp.time)
    for rho in job.theory.rhos:
        turn = g_over_l * np.cos(ramp["state"][:, 0])
        lag = steady_ramp_error(rho, turn, friction) * slope
        peak = float(np.max(np.abs(lag[chosen])))
        yield Metric.at("order2", ("predicted_delay_radius", peak, "s"), rho=rho)


@part
def _radii(job: keys.Job, ramp: Series) -> Iterator[Metric]:
    """Ultimate bound of ||e|| in (16), by the linear error system with |xi| at the threshold.

    The larger one of the hanging and the upright pendulum, for the worst remainder and rate of the
    delay within their bounds, with the numbers of Fig. 2.
    """
    g_over_l, friction, G = build_model(job.plant, "pendulum").parameters
    tau = delay_bounds(job.plant)[1]
    u = input_and_derivatives("sine", Signal.parse("sine", job.theory.sine, 1), max(ORDERS) + 1)
    U = [float(np.max(np.abs(signal(ramp.time)))) for signal in u]
    moving = ramp.time > max(ramp.events["jumps"], default=0.0)
    eta = float(np.max(np.abs(np.gradient(ramp["delay"][moving], ramp.time[moving]))))
    for m, name in ORDERS.items():
        xi = named(job.observers, name, keys.Extended).threshold
        # G |gamma_m| by (7), and c_0 of (19)
        remainder = G * tau ** (m + 1) / factorial(m + 1) * U[m + 1]
        remainder += G * sum(tau**i / factorial(i) * U[i] for i in range(2, m + 1))
        scale = np.array([1.0, 1.0, 1.0 / xi if xi else np.inf])  # lambda(xi)^-1
        for rho in job.theory.rhos:
            radii = []
            for turn in (1.0, -1.0):
                gains = peak_gains(error_matrix(rho, turn * g_over_l, friction))
                peak = gains[:, 1] * remainder + gains[:, 2] * xi * eta
                radii.append(np.linalg.norm(scale * peak))
            yield Metric.at(f"order_{m}", ("ultimate_bound", float(max(radii)), "1"), rho=rho)


@part
def _proof_radii(job: keys.Job, ramp: Series) -> Iterator[Metric]:
    """The r of (16) by (28) to (31), for m = 2 with the threshold and the sine of Fig. 2.

    (31) bounds V by (c_4 / c_3)^2, and with it e = Delta_rho^-1 lambda^-1 e_bar.
    """
    g_over_l, friction, G = build_model(job.plant, "pendulum").parameters
    tau = delay_bounds(job.plant)[1]
    u = input_and_derivatives("sine", Signal.parse("sine", job.theory.sine, 1), 3)
    U = [float(np.max(np.abs(signal(ramp.time)))) for signal in u]
    moving = ramp.time > max(ramp.events["jumps"], default=0.0)
    eta = float(np.max(np.abs(np.gradient(ramp["delay"][moving], ramp.time[moving]))))
    xi = named(job.observers, ORDERS[2], keys.Extended).threshold
    nu = G * (U[2] + tau * U[3] / 2 + eta * U[2] / 2)  # of xi with the true delay
    c_0 = G * tau**2 / 2 * U[2]
    gamma = G * tau**3 / 6 * U[3] + eta
    S = lyapunov_matrix(3, 1.0)
    low, high = np.linalg.eigvalsh(S)[[0, -1]]
    for rho in _LARGE_GAINS:
        c_1 = float(np.linalg.norm([g_over_l / rho, friction]))  # of (24) and (25)
        c_3 = (rho * low - 2 * high * (c_1 + nu / xi)) / high
        c_4 = 2 * high * (c_0 / rho + gamma) / np.sqrt(low)
        back = max(1.0, rho, rho**2 / xi)  # |Delta_rho^-1 lambda^-1|
        radius = back * c_4 / c_3 / np.sqrt(low) if c_3 > 0 else np.inf
        yield Metric.at("order_2", ("proof_radius", float(radius), "1"), rho=rho)


@part
def _held() -> Iterator[Metric]:
    """Largest V' / (rho V) of (27) where the projection (11) holds the delay (Remark 3.2).

    In e_bar the error obeys e' = rho (A_bar - S_1^-1 C^T C) e, if nothing drives it. Without the
    projection V' <= -rho V. At the upper bound, with xi > 0, e_3 >= 0 stays as it is where it would
    grow.
    """
    S = lyapunov_matrix(3, 1.0)
    e = random_stream(0, "delay", "theory", "held").normal(size=(_STATES, 3))
    e[:, 2] = np.abs(e[:, 2])
    rate = e @ (np.eye(3, k=1) - np.outer(high_gain(3, 1.0), np.eye(3)[0])).T
    held = rate[:, 2] > 0
    rate[held, 2] = 0.0
    growth = 2.0 * np.sum(e @ S * rate, axis=1) / np.sum(e @ S * e, axis=1)
    yield Metric("projection", "lyapunov_rate", float(np.max(growth[held])), "1")


def peak_gains(matrix: Array) -> Array:
    """Peak gains from each input to each state of x' = M x + w, or inf if M is not stable.

    The integral of |exp(M t)| over all t >= 0, shape (n, n). Lechappe et al. 2018, Remark 3.6.
    """
    slow = float(np.max(np.linalg.eigvals(matrix).real))
    if slow >= 0:
        return np.full(matrix.shape, np.inf)
    doublings = 16
    step = -40.0 / slow / 2**doublings
    responses, power = np.eye(len(matrix))[np.newaxis], expm(step * matrix)
    for _ in range(doublings):
        responses = np.concatenate([responses, responses @ power])
        power = power @ power
    integral: Array = np.trapezoid(np.abs(responses), dx=step, axis=0)
    return integral


def error_matrix(rho: float, g_over_l: float, friction: float) -> Array:
    """Matrix of the error system of x1, x2 and xi tau, shape (3, 3), for a constant xi.

    Lechappe et al. 2018, (14).

    ``g_over_l`` is g/l cos x1 [1/s^2], ``friction`` k/m [1/s].
    """
    matrix = np.eye(3, k=1)
    matrix[:, 0] -= high_gain(3, rho)
    matrix[1, :2] -= g_over_l, friction
    return matrix


def steady_ramp_error(rho: float, g_over_l: Any, friction: float) -> Any:
    """Steady-state error of the delay over its rate [s], by the linear error system."""
    return -(3 * rho * friction + 3 * rho**2 + g_over_l) / rho**3
