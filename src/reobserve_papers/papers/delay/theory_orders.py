"""Orders of the expansion: errors of each on the sine, and where xi vanishes."""

from __future__ import annotations

from collections.abc import Iterator
from math import factorial

import numpy as np
from numpy.typing import NDArray

from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.fixed_step import run_on_halves
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.responses import root_mean_square, scored
from reobserve_papers.metrics.theory_parts import part
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.scoring import singular_instants
from reobserve_papers.papers.delay.setup import build_model, delay_bounds, input_and_derivatives
from reobserve_papers.parameters.job import named
from reobserve_papers.signals.grid import stride
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]

SEED = 0
ORDERS = (1, 2, 3)
AWAY = 4.0  # from an instant with u' = 0 [s]
RUNS = 10  # from random initial estimates


def measure(job: keys.Job, sine: Series) -> Iterator[Metric]:
    """Metrics on the sine without noise, with the threshold of Fig. 2."""
    yield from _more_derivatives(job, sine)
    yield from _starts_on_the_sine(job, sine)
    yield from _zeros_of_xi(job, sine)


def rows_of(job: keys.Job, sine: Series, order: int) -> tuple[Array, Array]:
    """y and u with its derivatives up to an order, at half the steps of the observer of Fig. 2."""
    every = stride(job.plant.step, _body(job).sampling_period)
    signals = input_and_derivatives("sine", Signal.parse("sine", job.theory.sine, 1), order)
    u = np.hstack([signal(sine.time[::every]) for signal in signals])
    return np.ascontiguousarray(sine["state"][::every, 0]), u


def built(job: keys.Job, rho: float, order: int) -> ExtendedHighGainObserver:
    """The observer of Fig. 2 with another gain and order, and with the algebraic S."""
    body = _body(job)
    return ExtendedHighGainObserver(
        build_model(job.plant, body.model), rho=rho, order=order,
        delay_bounds=delay_bounds(job.plant), threshold=body.threshold,
        switched=body.switched, sampling_period=body.sampling_period,
    )  # fmt: skip


def _body(job: keys.Job) -> keys.Extended:
    return named(job.observers, "order2_noise", keys.Extended)


@part
def _more_derivatives(job: keys.Job, sine: Series) -> Iterator[Metric]:
    """Errors where the delay varies and away from singular instants, and the rate of xi^."""
    body, rules = _body(job), job.metrics
    every = 2 * stride(job.plant.step, body.sampling_period)
    time, truth = sine.time[::every], np.column_stack([sine["state"], sine["delay"]])[::every]
    chosen = scored("metrics.varying_from", time, rules.varying_from, rules.varying_until)
    late = scored("metrics.radius", time, rules.radius[0], rules.varying_until)
    near = np.abs(time[:, np.newaxis] - singular_instants(sine)).min(axis=1) < AWAY
    for order in ORDERS:
        y, u = rows_of(job, sine, order)
        for rho in job.theory.rhos:
            observer = built(job, rho, order)
            start = observer.init(body.initial_estimate, delay=body.initial_delay)
            run = run_on_halves(observer, y, u, start=start)
            error = np.column_stack([run["state"], run["delay"]]) - truth
            value = float(root_mean_square(error[chosen, -1]))
            away = float(np.linalg.norm(error[late & ~near], axis=1).max(initial=0.0))
            xi = observer.model.parameters[-1] * _xi(order, run["delay"], u[::2, 1:].T)
            rate = float(np.max(np.abs(np.diff(xi)))) / body.sampling_period
            for score in (
                ("varying_rms_delay_error", value, "s"),
                ("radius_away", away, "1"),
                ("rate_of_xi", rate, "N/(kg m s^2)"),
            ):
                yield Metric.at(f"order_{order}", score, rho=rho)


@part
def _starts_on_the_sine(job: keys.Job, sine: Series) -> Iterator[Metric]:
    """Differences that random initial estimates leave at the end, and without an observer."""
    body = _body(job)
    stream = random_stream(SEED, "delay", "theory", "starts on the sine")
    y, u = rows_of(job, sine, body.order)
    observer = built(job, body.rho, body.order)
    starts = [
        np.append(stream.normal(size=2), stream.uniform(*delay_bounds(job.plant)))
        for _ in range(RUNS)
    ]
    ends = []
    for start in starts:
        run = run_on_halves(observer, y, u, start=observer.init(start[:2], delay=start[2]))
        ends.append(np.append(run["state"][-1], run["delay"][-1]))
    for name, estimates in (("starts", ends), ("guess", starts)):
        spread = float(np.max(np.ptp(estimates, axis=0)))
        yield Metric(name, "spread_on_the_sine", spread, "1")


@part
def _zeros_of_xi(job: keys.Job, sine: Series) -> Iterator[Metric]:
    """Sign changes of xi (10) with the true delay, from the last jump of the delay on."""
    last = max(sine.events["jumps"], default=0.0)
    time, delay = sine.time[sine.time >= last], sine["delay"][sine.time >= last]
    signals = input_and_derivatives("sine", Signal.parse("sine", job.theory.sine, 1), max(ORDERS))
    rates = [signal(time)[:, 0] for signal in signals[1:]]
    for order in ORDERS:
        xi = _xi(order, delay, rates)
        zeros = float(np.count_nonzero(xi[1:] * xi[:-1] < 0))
        yield Metric(f"order_{order}", "zeros_of_xi", zeros, "1")


def _xi(order: int, delay: Array, rates: list[Array] | Array) -> Array:
    """The factor xi (10) over G, from the derivatives of the input."""
    terms = [(-delay) ** (i - 1) / factorial(i) * -rates[i - 1] for i in range(1, order + 1)]
    return np.asarray(np.sum(terms, axis=0))
