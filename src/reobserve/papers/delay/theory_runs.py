"""What the paper says of its observer in words, by runs without the noise of its figures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.ledger.types import Job, named
from reobserve.numerics.random_streams import random_stream
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.fixed_step import run_on_halves
from reobserve.papers.delay import keys
from reobserve.papers.delay.observe import estimate
from reobserve.papers.delay.plant import simulate
from reobserve.papers.delay.scoring import constant_segments, errors
from reobserve.papers.delay.setup import build_model, delay_bounds
from reobserve.scoring.metrics import Metric
from reobserve.scoring.responses import root_mean_square, window
from reobserve.timeseries.grid import stride
from reobserve.timeseries.series import Channel, Series

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

SEED = 0
ORDERS = {1: "order1_noise", 2: "order2_noise"}  # the observers of Fig. 2, by m


def measure(job: Job, ramp: Series, sine: Series) -> Iterator[Metric]:
    """Numbers from runs on the record of the ramp and on that of the sine, both without noise."""
    yield from _radius_on_the_ramp(job, ramp)
    yield from _wrong_derivatives(job, ramp)
    yield from _projection(job, ramp)
    yield from _radius_on_the_sine(job, sine)
    yield from _singular_peaks(job, sine)
    yield from _noise_of_the_amplitude(job, sine)


# The observers that runs beside the figures are about, by name and form.
NEEDED: dict[str, type] = {
    **dict.fromkeys((*ORDERS.values(), "order2", "order2_noise"), keys.Extended),
    "standard_noise": keys.Standard,
}


def record(job: Job, terms: Any, output_noise: float = 0, input_noise: float = 0) -> Any:
    """The pendulum's record under an input; deviations of the noise in rad and N m."""
    scenario = keys.Scenario(
        model="pendulum",
        initial_state=job.theory.initial_state,
        input=terms,
        output_noise=output_noise,
        input_noise=input_noise,
    )
    return simulate(Job(job.plant, SEED, scenario))


def singular_instants(plant: Series) -> Array:
    """When u' changes its sign [s], by straight lines between samples."""
    time, rate = plant.time, plant["input_derivatives"][:, 0]
    last = np.flatnonzero(rate[:-1] * rate[1:] < 0)
    share = rate[last] / (rate[last] - rate[last + 1])
    found: Array = np.concatenate([time[last] + share * plant.step, time[rate == 0]])
    return np.sort(found)


def near_and_away(job: Job, plant: Series, time: Array) -> tuple[list[Mask], Mask]:
    """Around each singular instant, and away from all; both after the last jump is forgotten."""
    away = job.theory.away
    settled = time > max(plant.events["jumps"], default=0.0) + away
    near = [settled & (np.abs(time - at) < away) for at in singular_instants(plant)]
    others = settled.copy()
    for chosen in near:
        others &= ~chosen
    return [chosen for chosen in near if chosen.any()], others


def _delay_error(job: Job, name: str, plant: Series, **changes: Any) -> tuple[Array, Array]:
    """Times and the error of the delay of an observer of the ledger, some values of it changed.

    What is made of the error comes long after the dynamic gain has come to rest at the algebraic
    one, which is taken from the start.
    """
    step = job.theory.sampling_period
    common = {"derivatives": "exact", "initial_matrix": "algebraic", "sampling_period": step}
    body = replace(named(job.observers, name, keys.Extended), **(common | changes))
    found = estimate(Job(job.plant, observer=body), plant)
    return found.time, errors(plant, found)["delay"]


def _radius_on_the_ramp(job: Job, ramp: Series) -> Iterator[Metric]:
    step = job.observers["order2"].sampling_period
    for rho in job.theory.rhos:
        time, error = _delay_error(job, "order2", ramp, rho=rho, sampling_period=step)
        moving = error[window(time, *job.metrics.varying)]
        peak = float(np.max(np.abs(moving)))
        yield Metric.at("order2", ("varying_peak_delay_error", peak, "s"), rho=rho)


def _radius_on_the_sine(job: Job, sine: Series) -> Iterator[Metric]:
    for order, name in ORDERS.items():
        step = job.observers[name].sampling_period
        for rho in job.theory.rhos:
            time, error = _delay_error(job, name, sine, rho=rho, sampling_period=step)
            value = float(root_mean_square(error[near_and_away(job, sine, time)[1]]))
            yield Metric.at(f"order_{order}", ("rms_delay_error", value, "s"), rho=rho)


def _wrong_derivatives(job: Job, ramp: Series) -> Iterator[Metric]:
    """u' too large by a share: what is left of the error before the jumps (Remark 3.5)."""
    for share in job.theory.derivative_errors:
        rates = (1 + share) * ramp["input_derivatives"]
        channels = {**ramp.channels, "input_derivatives": Channel(rates, "N m/s, N m/s^2")}
        wrong = Series(ramp.time, channels, ramp.events)
        time, error = _delay_error(job, "order2", wrong)
        late = np.zeros(len(time), dtype=bool)
        for _, start, end in constant_segments(ramp, job.metrics.late):
            late |= window(time, start, end)
        peak = float(np.max(np.abs(error[late])))
        yield Metric.at("order2", ("late_delay_error", peak, "s"), share=share)


def _projection(job: Job, ramp: Series) -> Iterator[Metric]:
    """Random starts and gains, the algebraic S that peaks most: is the interval kept (Lemma 1)?"""
    stream = random_stream(SEED, "delay", "theory", "projection")
    bounds = least, most = delay_bounds(job.plant)
    body = named(job.observers, "order2", keys.Extended)
    step = job.theory.sampling_period
    every = stride(job.plant, step)
    rows = slice(0, 2 * every * round(2.0 / step) + 1, every)
    y = np.ascontiguousarray(ramp["state"][rows, 0])
    u = np.column_stack([ramp["input"], ramp["input_derivatives"]])[rows, : body.order + 1]
    found = []
    for _ in range(job.theory.cases):
        rho = stream.uniform(1.0, 10.0)
        built = ExtendedHighGainObserver(
            build_model(job.plant, body.model), step, rho, body.order, bounds
        )
        start = built.init(stream.normal(size=2), stream.uniform(least, most))
        found.append(run_on_halves(built, y, u, state=start)["delay"])
    delays = np.array(found)
    yield Metric("projection", "least_delay", float(np.min(delays)), "s")
    yield Metric("projection", "greatest_delay", float(np.max(delays)), "s")
    touched = np.mean(np.any((delays == least) | (delays == most), axis=1))
    yield Metric("projection", "share_at_bounds", float(touched), "1")


def _singular_peaks(job: Job, sine: Series) -> Iterator[Metric]:
    for order, name in ORDERS.items():
        stated = job.observers[name].threshold
        small = job.theory.small_threshold
        for when, threshold in (("", stated), ("_hardly_off", small)):
            time, error = _delay_error(job, name, sine, threshold=threshold)
            near, others = near_and_away(job, sine, time)
            size = np.abs(error)
            peaks = float(np.mean([np.max(size[chosen]) for chosen in near]))
            yield Metric(f"order_{order}", f"singular_peak_delay_error{when}", peaks, "s")
            rest = float(np.max(size[others]))
            yield Metric(f"order_{order}", f"other_peak_delay_error{when}", rest, "s")


def _noise_of_the_amplitude(job: Job, sine: Series) -> Iterator[Metric]:
    """Noise of a share of what the measured signals reach in this very record."""
    share = job.theory.noise_share
    sizes = [share * float(np.max(np.abs(s))) for s in (sine["state"][:, 0], sine["input"])]
    noisy = record(job, job.theory.sine, *sizes)
    body = job.observers["order2_noise"]
    found = estimate(Job(job.plant, observer=body), noisy)
    later = window(found.time, job.metrics.start, np.inf)
    error = errors(noisy, found)
    yield Metric("literal_noise", "output_noise", sizes[0], "rad")
    value = float(root_mean_square(error["delay"][later]))
    yield Metric("literal_noise", "rms_delay_error", value, "s")
    deviation = noisy["delay"] - named(job.observers, "standard_noise", keys.Standard).mean_delay
    later = window(noisy.time, job.metrics.start, np.inf)
    value = float(root_mean_square(deviation[later]))
    yield Metric("mean_delay", "rms_delay_error", value, "s")
    later = window(noisy.time, *job.metrics.varying)
    value = float(root_mean_square(deviation[later]))
    yield Metric("mean_delay", "varying_rms_delay_error", value, "s")
