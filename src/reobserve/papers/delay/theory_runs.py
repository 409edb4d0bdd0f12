"""What the paper says of its observer in words, by runs without the noise of its figures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.random_streams import random_stream
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.fixed_step import run_on_halves
from reobserve.papers.delay import keys, noise
from reobserve.papers.delay.observe import estimate
from reobserve.papers.delay.plant import simulate
from reobserve.papers.delay.scoring import constant_segments, errors, near_and_away
from reobserve.papers.delay.setup import build_model, delay_bounds
from reobserve.papers.delay.theory_gains import FIGURES, error_matrix, noise_gain
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.replication.metrics.responses import root_mean_square, window
from reobserve.replication.parameters.job import Job, named
from reobserve.signals.grid import stride
from reobserve.signals.series import Channel, Series

Array = NDArray[np.float64]

SEED = 0
DECAY = (5.0, 10.0)  # [s], when the fast part of the start is over and the delay has not jumped yet
ORDERS = {1: "order1_noise", 2: "order2_noise"}  # the observers of Fig. 2, by m


def measure(job: Job, ramp: Series, sine: Series) -> Iterator[Metric]:
    """Numbers from runs on the record of the ramp and on that of the sine, both without noise.

    Lechappe et al. 2018, (32).
    """
    yield from _radius_on_the_ramp(job, ramp)
    yield from _wrong_derivatives(job, ramp)
    yield from _decay(job, ramp)
    yield from _projection(job, ramp)
    yield from _radius_on_the_sine(job, sine)
    yield from _singular_peaks(job, sine)
    yield from _faster(job, sine)
    yield from _mean_delay(job, sine)


# The observers that runs beside the figures are about, by name and form.
NEEDED: dict[str, type] = {
    **dict.fromkeys((*ORDERS.values(), "order2", "order2_noise"), keys.Extended),
    "standard_noise": keys.Standard,
}


def record(job: Job, terms: Any) -> Series:
    """The pendulum's record under an input, without noise."""
    start = job.theory.initial_state
    return simulate(Job(job.plant, SEED, keys.Scenario("pendulum", start, terms, "continued", 0.0)))


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


@part
def _radius_on_the_ramp(job: Job, ramp: Series) -> Iterator[Metric]:
    step = job.observers["order2"].sampling_period
    for rho in job.theory.rhos:
        time, error = _delay_error(job, "order2", ramp, rho=rho, sampling_period=step)
        moving = error[window(time, *job.metrics.varying)]
        peak = float(np.max(np.abs(moving)))
        yield Metric.at("order2", ("varying_peak_delay_error", peak, "s"), rho=rho)


@part
def _decay(job: Job, ramp: Series) -> Iterator[Metric]:
    """How fast the error of a constant delay falls, over what the linear error system says."""
    stiffness, friction, _ = build_model(job.plant, "pendulum").parameters
    for name in FIGURES:
        rho = job.observers[name].rho
        time, error = _delay_error(job, name, ramp, threshold=0.0)
        first, last = (float(error[np.searchsorted(time, at)]) for at in DECAY)
        slow = np.max(np.linalg.eigvals(error_matrix(rho, stiffness, friction)).real)
        rate = np.log(last / first) / (DECAY[1] - DECAY[0])
        yield Metric(name, "decay_over_pole", float(rate / slow), "1")


@part
def _radius_on_the_sine(job: Job, sine: Series) -> Iterator[Metric]:
    stiffness, friction, gain = build_model(job.plant, "pendulum").parameters
    angle, u = sine["state"][:, 0], sine["input"]
    size, _ = noise.deviations(job.plant, job.theory.noise_share, angle, u)
    xi = gain * float(np.max(np.abs(sine["input_derivatives"][:, 0])))
    for order, name in ORDERS.items():
        step = job.observers[name].sampling_period
        for rho in job.theory.rhos:
            time, error = _delay_error(job, name, sine, rho=rho, sampling_period=step)
            value = float(root_mean_square(error[near_and_away(sine, time, job.metrics.away)[1]]))
            yield Metric.at(f"order_{order}", ("rms_delay_error", value, "s"), rho=rho)
            # Noise adds what the linear error system makes of it where it harms least.
            share = noise_gain(rho, stiffness, friction, xi, job.plant.noise_period)
            whole = float(np.hypot(value, size * share))
            yield Metric.at(f"order_{order}", ("rms_delay_error_in_noise", whole, "s"), rho=rho)


@part
def _faster(job: Job, sine: Series) -> Iterator[Metric]:
    """Remark 4.1: the error with a faster input and a delay that is shorter by as much, over the
    one without, for m = 2 and the gains of the figures, from where the last jump is forgotten.
    """
    factor, name = job.theory.faster, ORDERS[2]
    short = [_scaled(term, 1 / factor, ("size", "amplitude")) for term in job.plant.delay]
    quick = [_scaled(term, factor, ("frequency", "slope")) for term in job.theory.sine]
    changed = replace(job, plant=replace(job.plant, delay=short))
    fast = record(changed, quick)
    step = job.observers[name].sampling_period
    begin = max(sine.events["jumps"], default=0.0) + job.metrics.away
    for rho in dict.fromkeys(job.observers[of].rho for of in FIGURES):
        found = []
        for plant in (sine, fast):
            time, error = _delay_error(job, name, plant, rho=rho, sampling_period=step)
            if job.theory.accuracy == "relative":
                error = error / plant["delay"][:: round((len(plant.time) - 1) / (len(time) - 1))]
            found.append(float(root_mean_square(error[time >= begin])))
        yield Metric.at("order_2", ("rms_delay_error_faster", found[1] / found[0], "1"), rho=rho)


def _scaled(term: dict[str, Any], factor: float, keys_: tuple[str, ...]) -> dict[str, Any]:
    """A term of a signal with some of its numbers multiplied."""
    return {key: factor * value if key in keys_ else value for key, value in term.items()}


@part
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


@part
def _projection(job: Job, ramp: Series) -> Iterator[Metric]:
    """Random starts and gains, the algebraic S that peaks most: is the interval kept (Lemma 1)?

    And with the gain of Fig. 1, does the error vanish where the projection has acted, as it does
    without (Remark 3.2)?
    """
    stream = random_stream(SEED, "delay", "theory", "projection")
    bounds = least, most = delay_bounds(job.plant)
    body = named(job.observers, "order2", keys.Extended)
    model, step = build_model(job.plant, body.model), job.theory.sampling_period
    every = stride(job.plant, step)
    first = min(ramp.events["jumps"], default=ramp.time[-1])
    y = np.ascontiguousarray(ramp["state"][::every, 0])
    u = np.column_stack([ramp["input"], ramp["input_derivatives"]])[::every, : body.order + 1]
    found: list[Array] = []
    late: list[Array] = []
    for _ in range(job.theory.cases):
        rho = stream.uniform(1.0, 10.0)
        start = stream.normal(size=2), stream.uniform(least, most)
        for gain, end, kept in ((rho, 2.0, found), (body.rho, first - step, late)):
            rows = 2 * round(end / step) + 1
            built = ExtendedHighGainObserver(model, gain, body.order, bounds, sampling_period=step)
            run = run_on_halves(built, y[:rows], u[:rows], state=built.init(*start))
            kept.append(run["delay"])
    delays, kept_delays = np.array(found), np.array(late)
    yield Metric("projection", "least_delay", float(np.min(delays)), "s")
    yield Metric("projection", "greatest_delay", float(np.max(delays)), "s")
    yield Metric("projection", "share_at_bounds", float(np.mean(_met(delays, bounds))), "1")
    met = kept_delays[_met(kept_delays, bounds), -1]
    off = np.abs(met - ramp["delay"][2 * every * (kept_delays.shape[1] - 1)])
    yield Metric("projection", "late_delay_error", float(np.max(off)) if len(off) else np.nan, "s")


def _met(delays: Array, bounds: tuple[float, float]) -> NDArray[np.bool_]:
    """The runs that meet a bound of the delay."""
    found: NDArray[np.bool_] = np.any(np.isin(delays, bounds), axis=1)
    return found


@part
def _singular_peaks(job: Job, sine: Series) -> Iterator[Metric]:
    for order, name in ORDERS.items():
        stated = job.observers[name].threshold
        small = job.theory.small_threshold
        for when, threshold in (("", stated), ("_hardly_off", small)):
            time, error = _delay_error(job, name, sine, threshold=threshold)
            near, others = near_and_away(sine, time, job.metrics.away)
            size = np.abs(error)
            peaks = float(np.mean([np.max(size[chosen]) for chosen in near]))
            yield Metric(f"order_{order}", f"singular_peak_delay_error{when}", peaks, "s")
            rest = float(np.max(size[others]))
            yield Metric(f"order_{order}", f"other_peak_delay_error{when}", rest, "s")


@part
def _mean_delay(job: Job, sine: Series) -> Iterator[Metric]:
    """How wrong the average delay is as an estimate."""
    mean = named(job.observers, "standard_noise", keys.Standard).mean_delay
    for when, span in (("", (job.metrics.start, np.inf)), ("varying_", job.metrics.varying)):
        deviation = (sine["delay"] - mean)[window(sine.time, *span)]
        value = float(root_mean_square(deviation))
        yield Metric("mean_delay", f"{when}rms_delay_error", value, "s")
