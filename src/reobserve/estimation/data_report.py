"""The data report: what was done to a record and what the alarms found, as JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.estimation.dates import SECOND, spelled
from reobserve.estimation.refusals import Refusals

Array = NDArray[np.float64]

_FAST = 1e-5  # [s], of which microseconds are not enough
QUIET = 10.5  # periods without an alarm, after which an interval has ended
MOST_LISTED = 50  # gaps and other events that are listed one by one


@dataclass
class Interval:
    """A time over which an alarm is raised, and how large its column is there.

    ``mean`` and ``standard_deviation`` are those of the column's values, ``sigma`` is the standard
    deviation by the observer (root mean square), ``peak`` the value that is farthest off normal.
    """

    start: float
    end: float
    values: int = 0
    mean: float = 0.0
    squares: float = 0.0
    variances: float | None = None
    peak: float = 0.0

    def add(self, value: float, sigma: float | None, excess: Callable[[float], float]) -> None:
        """Take a value, by Welford's sums."""
        self.values += 1
        off = value - self.mean
        self.mean += off / self.values
        self.squares += off * (value - self.mean)
        if sigma is not None:
            self.variances = (self.variances or 0.0) + sigma**2
        if self.values == 1 or excess(value) > excess(self.peak):
            self.peak = value

    def summary(self) -> dict[str, float | None]:
        """The interval as the report has it."""
        spread = None if self.values < 2 else math.sqrt(self.squares / (self.values - 1))
        sigma = None if self.variances is None else math.sqrt(self.variances / self.values)
        return {
            "start": self.start, "end": self.end, "mean": self.mean,
            "standard_deviation": spread, "sigma": sigma, "peak": self.peak,
        }  # fmt: skip


@dataclass
class AlarmReport:
    """Findings of an alarm: whether, when and how large, and the source of its threshold.

    ``threshold`` is for both signs, ``above`` and ``below`` for one, each by ``sigmas`` standard
    deviations that the observer has, if there are any.
    ``start_up`` [s] after each start of the observer, at ``started``, it is not raised: ``hidden``
    counts rows beyond the threshold among the ``ignored`` ones, and the alarm may have begun
    ``earlier`` than its first row. ``after_gap`` are rows that may be beyond it for a gap.
    ``current`` is the latest interval, ``waiting`` values with their sigmas belong to it if it goes
    on.
    """

    unit: str
    start_up: float
    learns: bool = False
    threshold: float | None = None
    above: float | None = None
    below: float | None = None
    sigmas: float | None = None
    ignored: int = 0
    hidden: int = 0
    beyond: list[float] = field(default_factory=list)  # the first and the last of these now [s]
    earlier: float | None = None
    after_gap: int = 0
    surprised: bool = False  # by an innovation since the start
    settled: float | None = None  # deviation of a residual that was predicted last,
    before_gap: float | None = None  # and in a gap, or until it is over, before that
    near: int = 0  # rows since then that are near it
    seen: float | None = None  # the time of the last value
    resumed: float | None = None  # and of that after the last gap
    rows: int = 0
    first: float | None = None
    intervals: list[Interval] = field(default_factory=list)
    interval_count: int = 0  # before the current one
    current: Interval | None = None
    waiting: list[list[float | None]] = field(default_factory=list)
    started: float | None = None
    origin: float | None = None  # the time of the first estimate
    learned: int = 0
    mean: float = 0.0
    squares: float = 0.0
    ready: bool = False
    memory: list[list[float]] = field(default_factory=list)  # of a detector

    def start(self, time: float) -> None:
        """Forget what was before a start of the observer at a time."""
        self.started, self.surprised = time, False
        self.settled = self.before_gap = self.seen = self.resumed = None
        self.memory.clear()

    def excess(self, value: float) -> float:
        """The distance of a value beyond what is stated, or from the mean."""
        if self.above is None and self.below is None:
            return abs(value - self.mean)
        high = -math.inf if self.above is None else value - self.above
        return max(high, -math.inf if self.below is None else self.below - value)

    @property
    def bounds(self) -> list[float]:
        """Values that the column may not pass, if they do not depend on the row."""
        if self.sigmas is not None:
            return []
        both = [] if self.threshold is None else [-self.threshold, self.threshold]
        sides = [bound for bound in (self.above, self.below) if bound is not None]
        return [self.mean + bound for bound in both] + sides

    def close(self) -> None:
        """End the current interval."""
        if self.current is not None:
            self.interval_count += 1
            if len(self.intervals) < MOST_LISTED:
                self.intervals.append(self.current)
        self.current = None
        self.waiting.clear()

    def summary(self) -> dict[str, Any]:
        """The alarm's findings as the report has them."""
        listed = self.intervals + ([] if self.current is None else [self.current])
        learned = {"mean": self.mean, "learned": self.learned} if self.learns else {}
        limits = {name: getattr(self, name) for name in ("above", "below", "sigmas")}
        limits = {name: value for name, value in limits.items() if value is not None}
        return {
            "unit": self.unit, "threshold": self.threshold, **limits, **learned,
            "start_up": self.start_up, "hidden": self.hidden, "after_gap": self.after_gap,
            "rows": self.rows, "first": self.first, "earlier": self.earlier,
            "interval_count": self.interval_count + (self.current is not None),
            "intervals": [interval.summary() for interval in listed[:MOST_LISTED]],
        }  # fmt: skip


def follow(
    time: Array, values: Array, deviations: Array | None, raised: Array, entry: AlarmReport,
    period: float,
) -> None:  # fmt: skip
    """Add rows to intervals: interruptions that are shorter than ten periods belong to them."""
    sigmas = repeat(None, len(time)) if deviations is None else deviations.tolist()
    unknown = np.isnan(values) | np.isnan(raised)
    every = (time.tolist(), values.tolist(), sigmas, (raised == 1.0).tolist(), unknown.tolist())
    for now, column, deviation, on, lacks in zip(*every, strict=True):
        interval = entry.current
        if interval is None and not on:
            continue
        if interval is not None and now - interval.end > QUIET * period:
            entry.close()
            interval = None
        if on and interval is None:
            interval = entry.current = Interval(now, now)
            entry.first = now if entry.first is None else entry.first
        if interval is not None and not lacks:
            entry.waiting.append([column, deviation])
        if on and interval is not None:
            entry.rows += 1
            interval.end = now
            for value, sigma in entry.waiting:
                assert value is not None
                interval.add(value, sigma, entry.excess)
            entry.waiting.clear()


@dataclass
class DataReport:
    """Counts over a record, ``columns`` by the name of the column, times in [s] of the record.

    ``intervals`` are those between timestamps that follow one another, ``jitter`` the largest
    offset of one from its place on the grid, in sampling periods. ``left_out`` are lines of the
    file that are no rows, by the reason.
    ``origin`` [s since 1970] is what times count from if timestamps are dates: the whole second at
    or before the first one. ``latest`` [us since 1970] is the last date, and ``zone`` that of the
    clocks by which dates are spelled, or nothing if they have no offset. If timestamps are large
    numbers, times count from ``shift`` [s]; None before the first of them.
    """

    period: float = 1.0  # of sampling [s]
    rows: int = 0
    first: float | None = None
    last: float | None = None
    intervals: int = 0
    unbridged: float = 0.0  # [s], in gaps of a resampled record, which are no intervals
    jitter: float = 0.0
    lost: int = 0  # rows that the timestamps say are missing
    filling: int = 0  # of these, those that policies may fill
    repeated: int = 0
    unstamped: int = 0
    before_start: int = 0
    after_end: int = 0
    missing: dict[str, int] = field(default_factory=dict)
    filled: dict[str, int] = field(default_factory=dict)
    held: dict[str, int] = field(default_factory=dict)  # cells that were empty
    levels: dict[str, float] = field(default_factory=dict)  # of these columns, the last value
    saturated: dict[str, int] = field(default_factory=dict)
    outliers: dict[str, int] = field(default_factory=dict)  # beyond the gate of a filter
    angles: dict[str, list[float]] = field(default_factory=dict)  # the last one, and its turns
    gaps: list[list[float | None]] = field(default_factory=list)
    gap_count: int = 0
    dropped: int = 0  # rows inside gaps; of those that the record lacks, the first
    restarts: int = 0
    statuses: dict[str, int] = field(default_factory=dict)
    estimates: int = 0
    alarms: dict[str, AlarmReport] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    innovations: dict[str, Any] = field(default_factory=dict)  # statistics, by consistency.py
    origin: int | None = None
    left_out: dict[str, int] = field(default_factory=dict)
    latest: int | None = None
    shift: int | None = None
    zone: str = ""
    refusals = Refusals()  # which raises the first one, of a record that is no file

    def clock(self, timestamp: int | None) -> float:
        """The time [s] of the next timestamp [ns since 1970], nan for none, from the first on."""
        if timestamp is None:
            return math.nan
        self.latest = timestamp // 1000
        return self.since_origin(timestamp)

    def since_origin(self, timestamp: int) -> float:
        """The same, of a timestamp that is not read yet."""
        if self.origin is None:
            self.origin = timestamp // SECOND
        return (timestamp - self.origin * SECOND) / SECOND  # of whole numbers: rounded once

    @property
    def digits(self) -> int:
        """The number of digits behind the seconds of dates that are kept."""
        return 9 if self.period < _FAST else 6

    def nanoseconds(self, time: float) -> int:
        """The date [ns since 1970] at a time [s] of a record with dates."""
        assert self.origin is not None
        unit = 1000 if self.digits == 6 else 1
        return self.origin * SECOND + round(time * SECOND / unit) * unit

    def stamp(self, time: float) -> str:
        """A time [s] as results have it: a date, or of the record's own clock.

        Dates have digits behind the seconds, unless both they and the period are whole seconds.
        """
        if self.origin is not None:
            timestamp = self.nanoseconds(time)
            whole = self.period % 1.0 == 0.0 and timestamp % SECOND == 0
            return spelled(timestamp, self.zone, 0 if whole else self.digits)
        if not self.shift:
            return repr(time)
        whole_part, _, digits = f"{Decimal(repr(time)) + self.shift:.10f}".partition(".")
        return f"{whole_part}.{digits.rstrip('0') or '0'}"

    def said(self, time: float, digits: int = 9) -> str:
        """The same for messages, with a unit unless it is a date."""
        if self.origin is not None:
            return spelled(self.nanoseconds(time), self.zone)
        return f"{self.stamp(time) if self.shift else format(time, f'.{digits}g')} s"

    def count(self, table: dict[str, int], name: str, more: int) -> None:
        """Add to one of the tables."""
        if more:
            table[name] = table.get(name, 0) + int(more)

    def warn(self, sentence: str) -> None:
        """Keep a warning, once."""
        if sentence not in self.warnings:
            self.warnings.append(sentence)

    def open_gap(self, start: float) -> None:
        """A gap begins after the sample at ``start``."""
        self.gap_count += 1
        if len(self.gaps) < MOST_LISTED:
            self.gaps.append([start, None])

    def close_gap(self, end: float) -> None:
        """Close the gap, which ends with the sample at ``end``."""
        if self.gaps and self.gaps[-1][1] is None:
            self.gaps[-1][1] = end

    @property
    def mean_interval(self) -> float | None:
        """[s], of timestamps that follow one another, without what no policy bridges."""
        slots = self.intervals + self.lost
        if self.first is None or self.last is None or not slots:
            return None
        return (self.last - self.first - self.unbridged) / slots


# Counts by which a stream goes on, and nobody asks.
_INTERNAL = frozenset(
    ["unbridged", "angles", "levels", "filling", "latest", "shift", "origin", "period", "refusals"]
)
_TIMES = ("first", "last", "earlier", "gaps", "start", "end")


def _by_clock(content: Any, report: DataReport, is_time: bool = False) -> Any:
    """The same with all times by the record's own clock."""
    if isinstance(content, dict):
        return {name: _by_clock(value, report, name in _TIMES) for name, value in content.items()}
    if isinstance(content, list):
        return [_by_clock(value, report, is_time) for value in content]
    if not is_time or content is None:
        return content
    return content + (report.shift or 0) if report.origin is None else report.stamp(content)


def as_json(report: DataReport, about: Mapping[str, Any]) -> dict[str, Any]:
    """The whole report, with what else is known ``about`` the run."""
    content = {name: value for name, value in vars(report).items() if name not in _INTERNAL}
    content["alarms"] = {name: alarm.summary() for name, alarm in report.alarms.items()}
    return {**about, "mean_interval": report.mean_interval, **_by_clock(content, report)}
