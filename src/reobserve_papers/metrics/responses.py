"""Numbers that tell how large a signal is, and when: the errors of estimates, above all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, located
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]


def error_of(plant: Series, estimate: Series, channel: str) -> Array:
    """Estimate minus truth of a channel, at the samples of the estimate."""
    every = round(estimate.step / plant.step)
    error: Array = estimate[channel] - plant[channel][::every]
    return error


def window(
    time: Array, start: float, end: float, *, closed: Literal["left", "right"] = "left"
) -> NDArray[np.bool_]:
    """The samples from ``start`` to ``end`` [s], of which one bound is a sample of it, too.

    ``left`` takes the sample at the start, ``right`` the one at the end, for what follows from
    what began at the start.
    """
    slack = -1e-9 if closed == "left" else 1e-9
    chosen: NDArray[np.bool_] = (time > start + slack) & (time < end + slack)
    return chosen


def scored(
    key: str, time: Array, start: float, end: float, *, closed: Literal["left", "right"] = "left"
) -> NDArray[np.bool_]:
    """The samples of a `window` that are to be scored."""
    chosen = window(time, start, end, closed=closed)
    if not chosen.any():
        raise InputError(key, _empty(start, end, float(time[-1]), 1, float(time[-1] - time[-2])))
    return chosen


def check_windows(
    windows: Mapping[str, Sequence[float]],
    horizon: float,
    period: float,
    *,
    least: int = 1,
    closed: Literal["left", "right"] = "left",
) -> None:
    """Refuse windows by their keys among the metrics, before anything runs.

    Of samples ``period`` [s] apart from 0 to ``horizon`` [s] each must hold ``least``.
    """
    slack = -1e-9 if closed == "left" else 1e-9  # as in `window`
    with located("metrics"):
        for key, (start, end) in windows.items():
            first = max(np.floor((start + slack) / period) + 1.0, 0.0)
            last = min(np.ceil((end + slack) / period) - 1.0, round(horizon / period))
            if last - first + 1.0 < least:
                raise InputError(key, _empty(start, end, horizon, least, period))


def _empty(start: float, end: float, last: float, least: int, period: float) -> str:
    if start >= last:
        return f"starts at {start:g} s, must start before the end at {last:g} s"
    until = "the end" if end == np.inf else f"{end:.9g} s"
    number = ("a sample", "two samples", "three samples")[least - 1]
    return f"from {start:.9g} s to {until} must hold {number}; these are {period:g} s apart"


def root_mean_square(values: Array) -> Array:
    """Root mean square over samples, the first axis, or nan for none."""
    if not len(values):
        return np.full(values.shape[1:], np.nan)
    root: Array = np.sqrt(np.mean(values * values, axis=0))
    return root


def root_mean_square_of_steps(start: Array, end: Array) -> float:
    """Root mean square over time of a signal that runs straight from ``start`` to ``end`` a step.

    With the limits from inside each step a signal that jumps between steps is scored right;
    nan for no steps.
    """
    if not start.size:
        return float("nan")
    return float(np.sqrt(np.mean((start * start + start * end + end * end) / 3.0)))


def peak(*values: Array) -> float:
    """The largest absolute value in all arrays, or nan if they are empty."""
    sizes = [float(np.max(np.abs(array))) for array in values if array.size]
    return max(sizes, default=float("nan"))


def first_crossing(time: Array, start: Array, end: Array, level: float) -> float:
    """Time when |signal| first exceeds ``level``: inside a step, linearly, or by a jump.

    ``start`` and ``end`` are the signal's limits from inside the steps that begin at ``time``
    [s], which has one more entry, the end of the last step; nan if the level is never exceeded.
    """
    first, last = np.abs(start), np.abs(end)
    above = np.flatnonzero((first > level) | (last > level))
    if above.size == 0:
        return float("nan")
    k = int(above[0])
    if first[k] > level:
        return float(time[k])
    share = (level - first[k]) / (last[k] - first[k])
    return float(time[k] + share * (time[k + 1] - time[k]))


def settling_time(time: Array, start: Array, end: Array, band: float) -> float:
    """Time when |error| enters ``band`` for good: the end of the last step that leaves it.

    Arguments as for `first_crossing`; nan if the last step leaves it.
    """
    outside = np.flatnonzero(np.maximum(np.abs(start), np.abs(end)) > band)
    if outside.size == 0:
        return float(time[0])
    k = int(outside[-1]) + 1
    return float(time[k]) if k < len(time) - 1 else float("nan")
