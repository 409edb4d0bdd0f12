"""Numbers against the golden ones: how far each is off, in units of what it may be."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from reobserve.evidence.golden import tables
from reobserve.evidence.golden.deviation import Deviation, OtherCell
from reobserve.evidence.golden.files import (
    Golden,
    check_names,
    read_metrics,
    read_series,
    read_undetermined,
)
from reobserve.evidence.golden.kept import Array, Kept
from reobserve.timeseries.series import Channel


def compare(kept: Kept, paper: str, part: str, golden: Path) -> Iterator[Deviation | OtherCell]:
    """The numbers of a record, a figure, a table or a theory that leave their tolerances.

    Raises
    ------
    InputError
        If a golden file is missing, damaged or holds other columns or metrics than the figure.
    """
    return (one for one in differences(kept, paper, part, golden) if one.exceeds)


def differences(kept: Kept, paper: str, part: str, golden: Path) -> Iterator[Deviation | OtherCell]:
    """Every number with its golden one, of a column that which is furthest off; as `compare`."""
    if kept.cells is not None:
        yield from tables.differences(kept.cells, paper, part, golden)
        return
    if kept.series:
        yield from series_differences(kept, paper, part, golden)
    if kept.metrics or not kept.series:
        yield from metric_differences(kept.metrics, paper, part, golden)


def series_differences(record: Kept, paper: str, part: str, golden: Path) -> Iterator[Deviation]:
    """Of each series of a record, as `kept_records` gives them, its worst row; as `compare`."""
    found = record.series
    if found.keys() <= read_undetermined(golden).get(part, {}).keys():
        return  # nothing of it is kept, not even a file
    path = golden / f"{part}.series.csv"
    columns = read_series(golden, part)
    for name, column in _paired(path, columns, found, golden, part):
        values, kept = found[name].values, column.values
        if len(values) != len(kept):
            where = f"rows of {name}"
            yield Deviation(f"{paper} {part}", where, len(kept), len(values), 0.0, name)
            continue
        worst = int(np.argmax(off_by(values, kept)))
        yield Deviation(
            f"{paper} {part}",
            f"{name} at {worst * record.period:g} s",
            float(kept[worst]),
            float(values[worst]),
            column.tolerance.allowed,
            name,
        )


def metric_differences(
    found: Mapping[str, Channel], paper: str, part: str, golden: Path
) -> Iterator[Deviation]:
    """Each metric of a figure or of the theory; as `compare`."""
    path = golden / f"{part}.metrics.csv"
    metrics = read_metrics(golden, part)
    for name, metric in _paired(path, metrics, found, golden, part):
        yield Deviation(
            f"{paper} {part}", name,
            float(metric.values[0]), float(found[name].values[0]), metric.tolerance.allowed,
        )  # fmt: skip


def off_by(values: Array, golden: Array) -> Array:
    """How far numbers are off; none where both are the same or both nan, inf where one is nan."""
    same = (values == golden) | (np.isnan(values) & np.isnan(golden))
    with np.errstate(invalid="ignore"):  # inf - inf
        off = np.abs(values - golden)
    return np.where(same, 0.0, np.where(np.isnan(off), math.inf, off))


@dataclass(frozen=True)
class Worst:
    """What is furthest off among some numbers, in tolerances, and how many there are."""

    ratio: float = 0.0
    what: str = "nothing"
    count: int = 0
    exceeded: int = 0

    @classmethod
    def of(cls, found: Iterable[Deviation | OtherCell]) -> Worst:
        """The worst of these."""
        every = list(found)
        if not every:
            return cls()
        worst = max(every, key=lambda one: one.ratio)
        exceeded = sum(one.exceeds for one in every)
        return cls(worst.ratio, f"{worst.figure}, {worst.what}", len(every), exceeded)


def _paired(
    path: Path, columns: Mapping[str, Golden], found: Mapping[str, Channel], golden: Path, part: str
) -> Iterator[tuple[str, Golden]]:
    """The golden columns by name, after a look whether those that are found are all of them."""
    left_out = [name for name in read_undetermined(golden).get(part, {}) if name in found]
    check_names(path, [*columns, *left_out], list(found))
    return ((name, columns[name]) for name in found if name in columns)
