"""Errors of state and delay, and the windows over which they are judged."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from reobserve.replication.metrics.responses import error_of
from reobserve.signals.series import Series

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def errors(plant: Series, estimate: Series) -> dict[str, Array]:
    """The errors of an estimate: ``delay``, shape (k,), and ``state``, (k, n), if it has them."""
    return {
        name: error_of(plant, estimate, name)
        for name in ("delay", "state")
        if name in estimate.channels
    }


def constant_segments(plant: Series, length: float) -> Iterator[tuple[int, float, float]]:
    """The last ``length`` seconds before each jump of the delay: number, start and end [s]."""
    for number, jump in enumerate(plant.events["jumps"], start=1):
        yield number, jump - length, jump


def ripple(time: Array, values: Array) -> float:
    """From lowest to highest of what a straight line leaves."""
    slope, offset = np.polyfit(time, values, 1)
    return float(np.ptp(values - slope * time - offset))


def turned_over_at(plant: Series) -> float:
    """When the angle of the pendulum first leaves half a turn [s]; nan if it does not."""
    outside = np.flatnonzero(np.abs(plant["state"][:, 0]) > np.pi)
    return float(plant.time[outside[0]]) if outside.size else float("nan")


def singular_instants(plant: Series) -> Array:
    """When u' changes its sign [s], by straight lines between samples."""
    time, rate = plant.time, plant["input_derivatives"][:, 0]
    last = np.flatnonzero(rate[:-1] * rate[1:] < 0)
    share = rate[last] / (rate[last] - rate[last + 1])
    found: Array = np.concatenate([time[last] + share * plant.step, time[rate == 0]])
    return np.sort(found)


def near_and_away(plant: Series, time: Array, away: float) -> tuple[list[Mask], Mask]:
    """Around each singular instant, and ``away`` [s] from all; the last jump is forgotten by then.

    Of the instants those that lie in the time that is left.
    """
    settled = time > max(plant.events["jumps"], default=0.0) + away
    near = [settled & (np.abs(time - at) < away) for at in singular_instants(plant)]
    others = settled.copy()
    for chosen in near:
        others &= ~chosen
    return [chosen for chosen in near if chosen.any()], others
