"""Remark 3.4: the observer for an input gain that depends on the whole state, on the ramp."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reobserve.ledger.types import Job, named
from reobserve.papers.delay import keys
from reobserve.papers.delay.setup import build_model, input_and_derivatives
from reobserve.scoring.metrics import Metric
from reobserve.synthesis.high_gain import high_gain
from reobserve.timeseries.series import Series
from reobserve.timeseries.signals import Signal

Array = NDArray[np.float64]


def measure(job: Job, ramp: Series) -> Iterator[Metric]:
    """What is left of the errors in the last seconds before the first jump of the delay."""
    end = min(ramp.events["jumps"], default=float(ramp.time[-1]))
    time = np.linspace(end - job.metrics.late, end, 101)
    body = named(job.observers, "order2", keys.Extended)
    start = [*body.initial_estimate, body.initial_delay]
    found = simulate(job, job.theory.gain_of_rate, start, float(ramp["delay"][0]), time)
    delay = np.max(np.abs(found[:, 4] - ramp["delay"][0]))
    yield Metric("state_gain", "late_delay_error", float(delay), "s")
    rate = np.max(np.abs(found[:, 3] - found[:, 1]))
    yield Metric("state_gain", "late_rate_error", float(rate), "rad/s")


def simulate(job: Job, share: float, start: list[float], tau: float, time: Array) -> Array:
    """Pendulum and observer (9) with G of the estimate: x, x^ and tau^ at times, shape (k, 5).

    G(x) is the pendulum's times 1 + share sin x2, bounded and globally Lipschitz. The delay is
    constant, m = 1, which a ramp makes exact, S algebraic; nothing is projected.
    """
    stiffness, friction, scale = build_model(job.plant, "pendulum").parameters
    u, slope = input_and_derivatives("ramp", Signal.parse("ramp", job.theory.ramp, 1), 1)
    gains = high_gain(3, named(job.observers, "order2", keys.Extended).rho)

    def G(rate: float) -> float:
        return float(scale * (1 + share * np.sin(rate)))

    def slopes(t: float, z: Array) -> list[float]:
        angle, rate, angle_, rate_, tau_ = z
        late, now = u(np.array([t - tau, t]))[:, 0]
        xi = -G(rate_) * slope(np.array([t]))[0, 0]
        pull = -stiffness * np.sin([angle, angle_]) - friction * np.array([rate, rate_])
        off = angle_ - angle
        return [
            rate,
            pull[0] + G(rate) * late,
            rate_ - gains[0] * off,
            pull[1] + xi * tau_ + G(rate_) * now - gains[1] * off,
            -gains[2] * off / xi,
        ]

    first = [*job.theory.initial_state, *start]
    span = (0.0, float(time[-1]))
    found: Array = solve_ivp(slopes, span, first, t_eval=time, rtol=1e-8, atol=1e-10).y.T
    return found
