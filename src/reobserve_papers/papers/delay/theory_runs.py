"""Runs for statements on the observer that no figure shows, without noise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.fixed_step import run_on_halves
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.responses import root_mean_square, scored
from reobserve_papers.metrics.theory_parts import part
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.observe import estimate
from reobserve_papers.papers.delay.plant import simulate
from reobserve_papers.papers.delay.scoring import GUESS, errors, peaks
from reobserve_papers.papers.delay.setup import build_model, delay_bounds
from reobserve_papers.papers.delay.theory_gains import FIGURES, ORDERS
from reobserve_papers.parameters.job import named
from reobserve_papers.signals.grid import stride
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]

SEED = 0


def measure(job: keys.Job, ramp: Series, sine: Series) -> Iterator[Metric]:
    """Metrics from runs on the records of the ramp and the sine, both without noise."""
    yield from _radius_on_the_ramp(job, ramp)
    yield from _random_starts(job, ramp)
    yield from _singular_peaks(job, sine)
    yield from _faster(job, sine)
    yield from _mean_delay(job, sine)


# The observers of these runs, by name and type.
NEEDED: dict[str, type] = {
    **dict.fromkeys((*ORDERS.values(), "order2", "order2_noise"), keys.Extended),
    "standard_noise": keys.Standard,
}


def record(job: keys.Job, terms: Any) -> Series:
    """The pendulum's record for an input, without noise."""
    start = job.theory.initial_state
    return simulate(
        keys.Job(job.plant, SEED, keys.Scenario("pendulum", start, terms, "continued", 0.0))
    )


def _delay_error(
    job: keys.Job, observer: keys.Extended, plant: Series, step: float | None = None
) -> tuple[Array, Array]:
    """Times and error of the delay of an observer, with the step of the theory if none is given.

    It uses the algebraic gain from the start: the error is evaluated only long after the dynamic
    gain has converged to it.
    """
    step = job.theory.sampling_period if step is None else step
    body = replace(observer, derivatives="exact", initial_matrix="algebraic", sampling_period=step)
    result = estimate(keys.Job(job.plant, observer=body), plant)
    return result.time, errors(plant, result)["delay"]


@part
def _radius_on_the_ramp(job: keys.Job, ramp: Series) -> Iterator[Metric]:
    body = named(job.observers, "order2", keys.Extended)
    for rho in job.theory.rhos:
        time, error = _delay_error(job, replace(body, rho=rho), ramp, body.sampling_period)
        chosen = scored("metrics.radius", time, *job.metrics.radius)
        peak = float(np.max(np.abs(error[chosen])))
        yield Metric.at("order2", ("delay_radius", peak, "s"), rho=rho)


@part
def _faster(job: keys.Job, sine: Series) -> Iterator[Metric]:
    """Remark 4.1: the ratio of the errors with and without a faster input and a shorter delay.

    For m = 2 and the gains of the figures, where the delay varies; one factor for both changes. The
    accuracy is that of the delay in seconds or relative to the delay. Also the error with both over
    that of the average delay as a constant estimate, which is proportional to the delay as well.
    """
    factor, body = job.theory.faster, named(job.observers, ORDERS[2], keys.Extended)
    short = [_scaled(term, 1 / factor, ("size", "amplitude")) for term in job.plant.delay]
    quick = [_scaled(term, factor, ("frequency", "slope")) for term in job.theory.sine]
    changed = replace(job, plant=replace(job.plant, delay=short))
    fast = record(changed, quick)
    span = job.metrics.varying_from, job.metrics.varying_until
    mean = named(job.observers, "standard_noise", keys.Standard).mean_delay
    for rho in dict.fromkeys(named(job.observers, of, keys.Extended).rho for of in FIGURES):
        # Errors and delays, by what estimates.
        runs: dict[str, list[tuple[Array, Array]]] = {"order_2": [], "mean_delay": []}
        for plant, average in ((sine, mean), (fast, mean / factor)):
            other = replace(body, rho=rho)
            time, error = _delay_error(job, other, plant, body.sampling_period)
            delay = plant["delay"][:: round((len(plant.time) - 1) / (len(time) - 1))]
            chosen = scored("metrics.varying_from", time, *span)
            runs["order_2"].append((error[chosen], delay[chosen]))
            runs["mean_delay"].append((average - delay[chosen], delay[chosen]))
        constant = _size(runs["mean_delay"][1][0])
        for name, ((before, long), (after, brief)) in runs.items():
            for accuracy, ratio in (
                ("absolute", _size(after) / _size(before)),
                ("relative", _size(after / brief) / _size(before / long)),
            ):
                score = "rms_delay_error_faster", ratio, "1"
                yield Metric.at(name, score, accuracy=accuracy, rho=rho)
            share = _size(after) / constant
            yield Metric.at(name, ("share_of_constant_faster", share, "1"), rho=rho)


def _size(error: Array) -> float:
    return float(root_mean_square(error))


def _scaled(term: dict[str, Any], factor: float, keys_: tuple[str, ...]) -> dict[str, Any]:
    """A term of a signal with the numbers of some keys multiplied."""
    return {key: factor * value if key in keys_ else value for key, value in term.items()}


@part
def _random_starts(job: keys.Job, ramp: Series) -> Iterator[Metric]:
    """Errors before the first jump from random initial estimates, gain of Fig. 1 (Theorem 2).

    The metric `projection` takes only the runs that reach a bound of the delay (Remark 3.2). The
    algebraic S is used because it has the largest peak.
    """
    stream = random_stream(SEED, "delay", "theory", "starts")
    bounds = delay_bounds(job.plant)
    body = named(job.observers, "order2", keys.Extended)
    model, step = build_model(job.plant, body.model), job.theory.sampling_period
    every = stride(job.plant.step, step)
    end = min(ramp.events["jumps"], default=ramp.time[-1]) - step
    rows = 2 * round(end / step) + 1
    y = np.ascontiguousarray(ramp["state"][::every, 0])[:rows]
    u = np.column_stack([ramp["input"], ramp["input_derivatives"]])[::every, : body.order + 1]
    built = ExtendedHighGainObserver(
        model, rho=body.rho, order=body.order, delay_bounds=bounds, sampling_period=step
    )
    truth = np.append(ramp["state"][::every][rows - 1], ramp["delay"][::every][rows - 1])
    errors, unmoved, met = [], [], []
    for _ in range(job.theory.cases):
        start = built.init(stream.normal(size=model.states), delay=stream.uniform(*bounds))
        run = run_on_halves(built, y, u[:rows], start=start)
        errors.append(np.abs(np.append(run["state"][-1], run["delay"][-1]) - truth))
        unmoved.append(np.abs(start.values - truth))
        met.append(np.isin(run["delay"], bounds).any())
    for name, each in (("starts", errors), (GUESS, unmoved)):
        largest = np.max(each, axis=0)
        yield Metric(name, "late_delay_error", float(largest[2]), "s")
        yield Metric(name, "late_rate_error", float(largest[1]), "rad/s")
    limited = np.array(errors)[met, 2]
    late = float(np.max(limited)) if len(limited) else float("nan")
    yield Metric("projection", "late_delay_error", late, "s")


@part
def _singular_peaks(job: keys.Job, sine: Series) -> Iterator[Metric]:
    for order, name in ORDERS.items():
        body = named(job.observers, name, keys.Extended)
        small = job.theory.small_threshold
        for when, threshold in (("", body.threshold), ("_small_threshold", small)):
            time, error = _delay_error(job, replace(body, threshold=threshold), sine)
            size, distance = peaks(sine, time, error)
            yield Metric(f"order_{order}", f"peak_delay_error{when}", size, "s")
            yield Metric(f"order_{order}", f"peak_distance{when}", distance, "1")


@part
def _mean_delay(job: keys.Job, sine: Series) -> Iterator[Metric]:
    """Error of the average delay as an estimate."""
    mean = named(job.observers, "standard_noise", keys.Standard).mean_delay
    varying = job.metrics.varying_from, job.metrics.varying_until
    for when, key, span in (
        ("", "start", (job.metrics.start, np.inf)),
        ("varying_", "varying_from", varying),
    ):
        deviation = (sine["delay"] - mean)[scored(f"metrics.{key}", sine.time, *span)]
        yield Metric("mean_delay", f"{when}rms_delay_error", _size(deviation), "s")
    largest = float(np.max(np.abs(deviation)))
    yield Metric("mean_delay", "varying_largest_delay_error", largest, "s")
