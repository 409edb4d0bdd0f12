"""Errors of state and delay, and the windows over which they are computed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from reobserve_papers.metrics.metrics import Score
from reobserve_papers.metrics.responses import (
    check_windows,
    error_of,
    root_mean_square,
    scored,
    window,
)
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.units import UNITS
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

GUESS = "guess"  # as an observer of metrics: the estimate that stays where it begins


def check_rules(rules: keys.Metrics, horizon: float, period: float) -> None:
    """Refuse windows that hold no sample of estimates ``period`` [s] apart."""
    windows = {
        "start": (rules.start, np.inf),
        "late": (max(0.0, horizon - rules.late), horizon),
        "varying_from": (rules.varying_from, rules.varying_until),
        "radius": rules.radius,
    }
    check_windows(windows, horizon, period)
    ripple = {"ripple": (max(0.0, horizon - rules.ripple), horizon)}
    check_windows(ripple, horizon, period, least=3)


def errors(plant: Series, estimate: Series) -> dict[str, Array]:
    """The errors of an estimate: ``delay``, shape (k,), and ``state``, (k, n), if it has them."""
    return {
        name: error_of(plant, estimate, name)
        for name in ("delay", "state")
        if name in estimate.channels
    }


def rms_scores(
    rules: keys.Metrics, model: keys.Model, plant: Series, estimate: Series
) -> Iterator[Score]:
    """RMS errors of the delay and of the pendulum's states over three windows.

    Where the delay varies, its largest error, too.
    """
    error, units = errors(plant, estimate), UNITS[model][0].split(", ")
    for name, key, span in (
        ("rms_{}", "start", (rules.start, np.inf)),
        ("rms_{}_from_start", "start", (0.0, np.inf)),
        ("varying_rms_{}", "varying_from", (rules.varying_from, rules.varying_until)),
    ):
        chosen = scored(f"metrics.{key}", estimate.time, *span)
        if "delay" in error:
            value = float(root_mean_square(error["delay"][chosen]))
            yield name.format("delay_error"), value, "s"
        if "state" in error and model == "pendulum":  # the state of the lag is measured
            for i, value in enumerate(root_mean_square(error["state"][chosen])):
                yield name.format(f"error_{i + 1}"), float(value), units[i]
    if "delay" in error:
        yield "varying_largest_delay_error", float(np.max(np.abs(error["delay"][chosen]))), "s"


def constant_segments(plant: Series, length: float) -> Iterator[tuple[int, float, float]]:
    """The last ``length`` seconds before each jump of the delay: number, start and end [s]."""
    for number, jump in enumerate(plant.events["jumps"], start=1):
        yield number, jump - length, jump


def ripple(time: Array, values: Array) -> float:
    """Peak-to-peak deviation from a straight line, or nan for fewer than three samples."""
    if len(time) < 3:
        return float("nan")
    slope, offset = np.polyfit(time, values, 1)
    return float(np.ptp(values - slope * time - offset))


def turned_over_at(plant: Series) -> float:
    """Time at which the angle of the pendulum first exceeds half a turn [s], or nan if never."""
    outside = np.flatnonzero(np.abs(plant["state"][:, 0]) > np.pi)
    return float(plant.time[outside[0]]) if outside.size else float("nan")


def singular_instants(plant: Series) -> Array:
    """Times at which u' changes its sign [s], by linear interpolation."""
    time, rate = plant.time, plant["input_derivatives"][:, 0]
    last = np.flatnonzero(rate[:-1] * rate[1:] < 0)
    share = rate[last] / (rate[last] - rate[last + 1])
    times: Array = np.concatenate([time[last] + share * plant.step, time[rate == 0]])
    return np.sort(times)


def half_periods(plant: Series, time: Array) -> Iterator[tuple[float, Mask]]:
    """Each singular instant after the last jump, with the half period around it.

    A half period extends to the middle between neighbouring instants. The first and the last
    instant have one neighbour only, so they are left out.
    """
    instants = singular_instants(plant)
    middles = 0.5 * (instants[1:] + instants[:-1])
    for at, first, last in zip(instants[1:-1], middles[:-1], middles[1:], strict=True):
        if first > max(plant.events["jumps"], default=0.0):
            yield float(at), window(time, first, last)


def peaks(plant: Series, time: Array, error: Array) -> tuple[float, float]:
    """Mean of the largest errors in `half_periods`, and their mean distance from the instant.

    The distance is 0 at the singular instant and 1 in the middle between two. Both are `nan`
    without a half period.
    """
    sizes, distances = [], []
    for at, chosen in half_periods(plant, time):
        place = np.flatnonzero(chosen)[np.argmax(np.abs(error[chosen]))]
        half = 0.5 * (time[chosen][-1] - time[chosen][0])
        sizes.append(abs(error[place]))
        distances.append(abs(time[place] - at) / half)
    if not sizes:
        return float("nan"), float("nan")
    return float(np.mean(sizes)), float(np.mean(distances))
