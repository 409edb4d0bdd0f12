"""What the paper says of its observer in words, by runs without the noise of its figures."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.grid import stride
from reobserve.metrics import Metric, window
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.papers.delay.observe import estimate
from reobserve.papers.delay.plant import simulate
from reobserve.papers.delay.scoring import (
    constant_segments,
    errors,
    root_mean_square,
)
from reobserve.papers.delay.setup import build_model, delay_bounds
from reobserve.random_streams import random_stream
from reobserve.series import Channel, Series

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Settings = dict[str, Any]

SEED = 0
ORDERS = {1: "order1_noise", 2: "order2_noise"}  # the observers of Fig. 2, by m


def measure(settings: Settings, ramp: Series, sine: Series) -> Iterator[Metric]:
    """Numbers from runs on the record of the ramp and on that of the sine, both without noise."""
    yield from _radius_on_the_ramp(settings, ramp)
    yield from _wrong_derivatives(settings, ramp)
    yield from _projection(settings, ramp)
    yield from _radius_on_the_sine(settings, sine)
    yield from _singular_peaks(settings, sine)
    yield from _noise_of_the_amplitude(settings, sine)


def record(settings: Settings, terms: Any, output_noise: float = 0, input_noise: float = 0) -> Any:
    """The pendulum's record under an input; deviations of the noise in rad and N m."""
    scenario = {
        "model": "pendulum",
        "initial_state": settings["theory"]["initial_state"],
        "input": terms,
        "output_noise": output_noise,
        "input_noise": input_noise,
    }
    return simulate({"plant": settings["plant"], "scenario": scenario, "seed": SEED})


def singular_instants(plant: Series) -> Array:
    """When u' changes its sign [s], by straight lines between samples."""
    time, rate = plant.time, plant["input_derivatives"][:, 0]
    last = np.flatnonzero(rate[:-1] * rate[1:] < 0)
    share = rate[last] / (rate[last] - rate[last + 1])
    found: Array = np.concatenate([time[last] + share * plant.step, time[rate == 0]])
    return np.sort(found)


def near_and_away(settings: Settings, plant: Series, time: Array) -> tuple[list[Mask], Mask]:
    """Around each singular instant, and away from all; both after the last jump is forgotten."""
    away = settings["theory"]["away"]
    settled = time > max(plant.events["jumps"], default=0.0) + away
    near = [settled & (np.abs(time - at) < away) for at in singular_instants(plant)]
    others = settled.copy()
    for chosen in near:
        others &= ~chosen
    return [chosen for chosen in near if chosen.any()], others


def _delay_error(
    settings: Settings, name: str, plant: Series, **changes: Any
) -> tuple[Array, Array]:
    """Times and the error of the delay of an observer of the ledger, some values of it changed.

    What is made of the error comes long after the dynamic gain has come to rest at the algebraic
    one, which is taken from the start.
    """
    step = settings["theory"]["step_size"]
    common = {"derivatives": "exact", "initial_matrix": "algebraic", "step_size": step}
    body = {**settings["observers"][name], **common, **changes}
    found = estimate({"plant": settings["plant"], "observer": body}, plant)
    return found.time, errors(plant, found)["delay"]


def _radius_on_the_ramp(settings: Settings, ramp: Series) -> Iterator[Metric]:
    step = settings["observers"]["order2"]["step_size"]
    for rho in settings["theory"]["rhos"]:
        time, error = _delay_error(settings, "order2", ramp, rho=rho, step_size=step)
        moving = error[window(time, *settings["metrics"]["varying"])]
        name = f"varying_peak_delay_error_at_rho_{rho:g}"
        yield Metric("order2", name, float(np.max(np.abs(moving))), "s")


def _radius_on_the_sine(settings: Settings, sine: Series) -> Iterator[Metric]:
    for order, name in ORDERS.items():
        step = settings["observers"][name]["step_size"]
        for rho in settings["theory"]["rhos"]:
            time, error = _delay_error(settings, name, sine, rho=rho, step_size=step)
            value = float(root_mean_square(error[near_and_away(settings, sine, time)[1]]))
            yield Metric(f"order_{order}", f"rms_delay_error_at_rho_{rho:g}", value, "s")


def _wrong_derivatives(settings: Settings, ramp: Series) -> Iterator[Metric]:
    """u' too large by a share: what is left of the error before the jumps (Remark 3.5)."""
    for share in settings["theory"]["derivative_errors"]:
        rates = (1 + share) * ramp["input_derivatives"]
        channels = {**ramp.channels, "input_derivatives": Channel(rates, "N m/s, N m/s^2")}
        wrong = Series(ramp.time, channels, ramp.events)
        time, error = _delay_error(settings, "order2", wrong)
        late = np.zeros(len(time), dtype=bool)
        for _, start, end in constant_segments(ramp, settings["metrics"]["late"]):
            late |= window(time, start, end)
        name = f"late_delay_error_at_share_{share:g}"
        yield Metric("order2", name, float(np.max(np.abs(error[late]))), "s")


def _projection(settings: Settings, ramp: Series) -> Iterator[Metric]:
    """Random starts and gains, the algebraic S that peaks most: is the interval kept (Lemma 1)?"""
    stream = random_stream(SEED, "delay", "theory", "projection")
    bounds = least, most = delay_bounds(settings["plant"])
    body = settings["observers"]["order2"]
    step = settings["theory"]["step_size"]
    every = stride(settings["plant"], step)
    rows = slice(0, 2 * every * round(2.0 / step) + 1, every)
    y = np.ascontiguousarray(ramp["state"][rows, 0])
    u = np.column_stack([ramp["input"], ramp["input_derivatives"]])[rows, : body["order"] + 1]
    found = []
    for _ in range(int(settings["theory"]["cases"])):
        rho = stream.uniform(1.0, 10.0)
        built = ExtendedHighGainObserver(
            build_model(settings["plant"], body["model"]), step, rho, body["order"], bounds
        )
        start = built.init(stream.normal(size=2), stream.uniform(least, most))
        found.append(built.run(y, u, start).delay)
    delays = np.array(found)
    yield Metric("projection", "least_delay", float(np.min(delays)), "s")
    yield Metric("projection", "greatest_delay", float(np.max(delays)), "s")
    touched = np.mean(np.any((delays == least) | (delays == most), axis=1))
    yield Metric("projection", "share_at_bounds", float(touched), "1")


def _singular_peaks(settings: Settings, sine: Series) -> Iterator[Metric]:
    for order, name in ORDERS.items():
        stated = settings["observers"][name]["threshold"]
        small = settings["theory"]["small_threshold"]
        for when, threshold in (("", stated), ("_hardly_off", small)):
            time, error = _delay_error(settings, name, sine, threshold=threshold)
            near, others = near_and_away(settings, sine, time)
            size = np.abs(error)
            peaks = float(np.mean([np.max(size[chosen]) for chosen in near]))
            yield Metric(f"order_{order}", f"singular_peak_delay_error{when}", peaks, "s")
            rest = float(np.max(size[others]))
            yield Metric(f"order_{order}", f"other_peak_delay_error{when}", rest, "s")


def _noise_of_the_amplitude(settings: Settings, sine: Series) -> Iterator[Metric]:
    """Noise of a share of what the measured signals reach in this very record."""
    share = settings["theory"]["noise_share"]
    sizes = [share * float(np.max(np.abs(s))) for s in (sine["state"][:, 0], sine["input"])]
    noisy = record(settings, settings["theory"]["sine"], *sizes)
    body = settings["observers"]["order2_noise"]
    found = estimate({"plant": settings["plant"], "observer": body}, noisy)
    later = window(found.time, settings["metrics"]["start"], np.inf)
    error = errors(noisy, found)
    yield Metric("literal_noise", "output_noise", sizes[0], "rad")
    value = float(root_mean_square(error["delay"][later]))
    yield Metric("literal_noise", "rms_delay_error", value, "s")
    deviation = noisy["delay"] - settings["observers"]["standard_noise"]["mean_delay"]
    later = window(noisy.time, settings["metrics"]["start"], np.inf)
    value = float(root_mean_square(deviation[later]))
    yield Metric("mean_delay", "rms_delay_error", value, "s")
    later = window(noisy.time, *settings["metrics"]["varying"])
    value = float(root_mean_square(deviation[later]))
    yield Metric("mean_delay", "varying_rms_delay_error", value, "s")
