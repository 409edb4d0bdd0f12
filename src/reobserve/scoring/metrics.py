"""Numbers that judge an estimate, and the table they are kept in."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError, shown
from reobserve.plain_data.files import NAME, SCORE, UNIT, read_table, write_table

Array = NDArray[np.float64]

HEADER = ("observer", "metric", "value", "unit")
KEY = ("observer", "metric")
KINDS = {"observer": NAME, "metric": NAME, "value": SCORE, "unit": UNIT}


@dataclass(frozen=True)
class Metric:
    """One number: whose, what, how much. ``nan`` where it does not exist."""

    observer: str
    metric: str
    value: float
    unit: str


def write_metrics(path: str | Path, metrics: Iterable[Metric]) -> None:
    """Write to CSV; `InputError` if the folder cannot be written."""
    write_table(path, (asdict(metric) for metric in metrics), HEADER)


def read_metrics(path: str | Path) -> list[Metric]:
    """Read what `write_metrics` wrote; `InputError` if the file is another, or names one twice."""
    return [
        Metric(row["observer"], row["metric"], float(row["value"]), row["unit"])
        for row in read_table(path, HEADER, KINDS, KEY)
    ]


class Numbers(dict[tuple[str, str], float]):
    """Values by (observer, metric); one that nobody has is refused by name."""

    def __missing__(self, key: tuple[str, str]) -> float:
        raise InputError("metrics", f"there is no {shown(key[1])} of {shown(key[0])}")


def lookup(metrics: Iterable[Metric]) -> Numbers:
    """Values by (observer, metric)."""
    return Numbers({(metric.observer, metric.metric): metric.value for metric in metrics})


def window(time: Array, start: float, end: float) -> NDArray[np.bool_]:
    """The samples from ``start`` to just before ``end`` [s]."""
    chosen: NDArray[np.bool_] = (time > start - 1e-9) & (time < end - 1e-9)
    return chosen


def root_mean_square(start: Array, end: Array) -> float:
    """Over time, of a signal that runs straight from ``start`` to ``end`` in each step.

    With the limits from inside each step a signal that jumps between steps is scored right;
    nan for no steps.
    """
    if not start.size:
        return float("nan")
    return float(np.sqrt(np.mean((start * start + start * end + end * end) / 3.0)))


def peak(*values: Array) -> float:
    """The largest absolute value in all arrays; nan if they are empty."""
    sizes = [float(np.max(np.abs(array))) for array in values if array.size]
    return max(sizes, default=float("nan"))


def first_crossing(time: Array, start: Array, end: Array, level: float) -> float:
    """When |signal| first exceeds ``level``: inside a step, linearly, or by a jump between two.

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
    """When |error| enters ``band`` for good: the end of the last step that leaves it.

    Arguments as for `first_crossing`; nan if the error is outside at the end.
    """
    outside = np.flatnonzero(np.maximum(np.abs(start), np.abs(end)) > band)
    if outside.size == 0:
        return float(time[0])
    k = int(outside[-1]) + 1
    return float(time[k]) if k < len(time) - 1 else float("nan")
