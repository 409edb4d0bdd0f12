"""Remark 3.4: the observer for an input gain that depends on the whole state."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import allocating_kernel
from reobserve.synthesis.high_gain_design import high_gain
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.responses import root_mean_square, scored
from reobserve_papers.metrics.theory_parts import part
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.setup import build_model, delay_bounds, input_and_derivatives
from reobserve_papers.parameters.job import named
from reobserve_papers.plants.delayed_input import delayed
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]


@part
def measure(job: keys.Job, ramp: Series) -> Iterator[Metric]:
    """Errors before the first jump of the delay on the ramp, and where it varies on the sine."""
    end = min(ramp.events["jumps"], default=float(ramp.time[-1]))
    body = named(job.observers, "order2", keys.Extended)
    start = [*body.initial_estimate, body.initial_delay]
    tau = float(ramp["delay"][0])
    states = simulate(job, job.theory.gain_of_rate, start, tau, end)
    late = states[-round(job.metrics.late / job.theory.sampling_period) :]
    delay, rate = late[:, 4] - tau, late[:, 3] - late[:, 1]
    yield Metric("state_gain", "late_delay_error", float(np.max(np.abs(delay))), "s")
    yield Metric("state_gain", "late_rate_error", float(np.max(np.abs(rate))), "rad/s")
    yield from _on_the_sine(job, start)


def _on_the_sine(job: keys.Job, start: list[float]) -> Iterator[Metric]:
    step, rules = job.theory.sampling_period, job.metrics
    for rho in job.theory.rhos:
        states = simulate_on_sine(job, job.theory.gain_of_rate, start, rho)
        time = step * np.arange(len(states), dtype=np.float64)
        delay = Signal.parse("delay", job.plant.delay, 1)(time)[:, 0]
        span = rules.varying_from, rules.varying_until
        error = (states[:, 4] - delay)[scored("metrics.varying_from", time, *span)]
        score = "varying_rms_delay_error", float(root_mean_square(error)), "s"
        yield Metric.at("state_gain", score, rho=rho)


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
    columns = (signals[0](half - tau), signals[0](half), signals[1](half), 0.0 * half[:, None])
    free = np.array([-np.inf, np.inf, 0.0])
    return _filled(job, share, start, columns, rho, free)


def simulate_on_sine(job: keys.Job, share: float, start: list[float], rho: float) -> Array:
    """Simulate as above, on the sine with the paper's delay, m = 2 and the threshold of Fig. 2.

    Here the delay is kept within its bounds, and only its gain is switched off.
    """
    step = job.theory.sampling_period
    signals = input_and_derivatives("sine", Signal.parse("sine", job.theory.sine, 1), 2)
    delay = Signal.parse("delay", job.plant.delay, 1)
    half = np.arange(2 * round(job.plant.horizon / step) + 1, dtype=np.float64) * (0.5 * step)
    now, *rates = (signal(half) for signal in signals)
    late = delayed(signals[0], delay, half)[:, np.newaxis]
    threshold = named(job.observers, "order2_noise", keys.Extended).threshold
    limits = np.array([*delay_bounds(job.plant), threshold])
    return _filled(job, share, start, (late, now, *rates), rho, limits)


def _filled(
    job: keys.Job, share: float, start: list[float], columns: Any, rho: float, limits: Array
) -> Array:
    states = np.empty((len(columns[0]) // 2 + 1, 5))
    states[0] = [*job.theory.initial_state, *start]
    parameters = np.array([*build_model(job.plant, "pendulum").parameters, share])
    step = job.theory.sampling_period
    _simulate(np.hstack(columns), parameters, high_gain(3, rho), limits, step, states)
    return states


@allocating_kernel
def _simulate(
    inputs: Array, parameters: Array, gains: Array, limits: Array, step: float, states: Array
) -> None:
    """Fill ``states`` by classical Runge-Kutta, with u(t - tau), u, u' and u'' as ``inputs``.

    ``limits`` are the bounds of the delay and the |xi| below which its gain is off.
    """
    g_over_l, friction, scale, share = parameters
    low, high, threshold = limits
    slopes = np.empty((4, 5))
    for k in range(len(states) - 1):
        for stage in range(4):
            z = states[k].copy()
            if stage > 0:
                z += (step if stage == 3 else 0.5 * step) * slopes[stage - 1]
                z[4] = min(max(z[4], low), high)
            late, now, slope, curve = inputs[2 * k + (stage + 1) // 2]
            off = z[2] - z[0]
            gain = scale * (1 + share * np.sin(z[1]))
            gain_ = scale * (1 + share * np.sin(z[3]))
            xi = -gain_ * (slope - 0.5 * z[4] * curve)
            slopes[stage, 0] = z[1]
            slopes[stage, 1] = -g_over_l * np.sin(z[0]) - friction * z[1] + gain * late
            slopes[stage, 2] = z[3] - gains[0] * off
            slopes[stage, 3] = -g_over_l * np.sin(z[2]) - friction * z[3] + gain_ * now
            slopes[stage, 3] += xi * z[4] - gains[1] * off
            slopes[stage, 4] = -gains[2] * off / xi if abs(xi) > threshold else 0.0
        mean = slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3]
        states[k + 1] = states[k] + step / 6 * mean
        states[k + 1, 4] = min(max(states[k + 1, 4], low), high)
