"""Remark 3.4: the observer for an input gain that depends on the whole state, on the ramp."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import allocating_kernel
from reobserve.synthesis.high_gain import high_gain
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.parts import part
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.setup import build_model, input_and_derivatives
from reobserve_papers.parameters.job import named
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]


@part
def measure(job: keys.Job, ramp: Series) -> Iterator[Metric]:
    """Errors in the last seconds before the first jump of the delay."""
    end = min(ramp.events["jumps"], default=float(ramp.time[-1]))
    body = named(job.observers, "order2", keys.Extended)
    start = [*body.initial_estimate, body.initial_delay]
    tau = float(ramp["delay"][0])
    found = simulate(job, job.theory.gain_of_rate, start, tau, end)
    late = found[-round(job.metrics.late / job.theory.sampling_period) :]
    delay, rate = late[:, 4] - tau, late[:, 3] - late[:, 1]
    yield Metric("state_gain", "late_delay_error", float(np.max(np.abs(delay))), "s")
    yield Metric("state_gain", "late_rate_error", float(np.max(np.abs(rate))), "rad/s")


def simulate(job: keys.Job, share: float, start: list[float], tau: float, end: float) -> Array:
    """Simulate pendulum and observer with G(x^): x, x^ and tau^ at steps, shape (k, 5).

    Lechappe et al. 2018, Remark 3.4.

    G(x) is the pendulum's times 1 + share sin x2, bounded and globally Lipschitz. The delay is
    constant, m = 1, which is exact for a ramp, and S is algebraic; there is no projection.
    """
    step = job.theory.sampling_period
    rho = named(job.observers, "order2", keys.Extended).rho
    signals = input_and_derivatives("ramp", Signal.parse("ramp", job.theory.ramp, 1), 1)
    half = np.arange(2 * round(end / step) + 1, dtype=np.float64) * (0.5 * step)
    columns = (signals[0](half - tau), signals[0](half), signals[1](half))
    states = np.empty((len(half) // 2 + 1, 5))
    states[0] = [*job.theory.initial_state, *start]
    parameters = np.array([*build_model(job.plant, "pendulum").parameters, share])
    _simulate(np.hstack(columns), parameters, high_gain(3, rho), step, states)
    return states


@allocating_kernel
def _simulate(inputs: Array, parameters: Array, gains: Array, step: float, states: Array) -> None:
    """Fill ``states`` by classical Runge-Kutta, with u(t - tau), u and u' as ``inputs``."""
    g_over_l, friction, scale, share = parameters
    slopes = np.empty((4, 5))
    for k in range(len(states) - 1):
        for stage in range(4):
            z = states[k].copy()
            if stage > 0:
                z += (step if stage == 3 else 0.5 * step) * slopes[stage - 1]
            late, now, slope = inputs[2 * k + (stage + 1) // 2]
            off = z[2] - z[0]
            gain = scale * (1 + share * np.sin(z[1]))
            gain_ = scale * (1 + share * np.sin(z[3]))
            xi = -gain_ * slope
            slopes[stage, 0] = z[1]
            slopes[stage, 1] = -g_over_l * np.sin(z[0]) - friction * z[1] + gain * late
            slopes[stage, 2] = z[3] - gains[0] * off
            slopes[stage, 3] = -g_over_l * np.sin(z[2]) - friction * z[3] + gain_ * now
            slopes[stage, 3] += xi * z[4] - gains[1] * off
            slopes[stage, 4] = -gains[2] * off / xi
        mean = slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3]
        states[k + 1] = states[k] + step / 6 * mean
