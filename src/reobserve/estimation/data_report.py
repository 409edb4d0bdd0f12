"""The data report: what was done to a record and what the alarms found, as a table and as JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from reobserve.estimation.dates import SECOND, spelled

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
        one = [bound for bound in (self.above, self.below) if bound is not None]
        return [self.mean + bound for bound in both] + one

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
        stated = {name: getattr(self, name) for name in ("above", "below", "sigmas")}
        stated = {name: value for name, value in stated.items() if value is not None}
        return {
            "unit": self.unit, "threshold": self.threshold, **stated, **learned,
            "start_up": self.start_up, "hidden": self.hidden, "after_gap": self.after_gap,
            "rows": self.rows, "first": self.first, "earlier": self.earlier,
            "interval_count": self.interval_count + (self.current is not None),
            "intervals": [interval.summary() for interval in listed[:MOST_LISTED]],
        }  # fmt: skip


@dataclass
class DataReport:
    """Counts over a record, ``columns`` by the name of the column, times in [s] of the record.

    ``intervals`` are those between timestamps that follow one another, ``jitter`` the largest
    offset of one from its place on the grid, in sampling periods. ``left_out`` are lines of the
    file that are no rows, by the reason.
    ``origin`` [s since 1970] is what times count from if timestamps are dates: the whole second at
    or before the first one.
    """

    rows: int = 0
    first: float | None = None
    last: float | None = None
    intervals: int = 0
    single: int = 0  # intervals of one period
    jitter: float = 0.0
    lost: int = 0  # rows that the timestamps say are missing
    repeated: int = 0
    unstamped: int = 0
    before_start: int = 0
    after_end: int = 0
    missing: dict[str, int] = field(default_factory=dict)
    filled: dict[str, int] = field(default_factory=dict)
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
    origin: int | None = None
    left_out: dict[str, int] = field(default_factory=dict)

    def clock(self, timestamp: int | None) -> float:
        """The time [s] of a timestamp [ns since 1970], nan for none, from the first one on."""
        if timestamp is None:
            return math.nan
        if self.origin is None:
            self.origin = timestamp // SECOND
        return (timestamp - self.origin * SECOND) / SECOND  # of whole numbers: rounded once

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
        """[s], over all intervals."""
        slots = self.intervals + self.lost
        if self.first is None or self.last is None or not slots:
            return None
        return (self.last - self.first) / slots


def as_json(report: DataReport, about: Mapping[str, Any]) -> dict[str, Any]:
    """The whole report, with what else is known ``about`` the run."""
    content = {
        name: value for name, value in vars(report).items() if name not in ("single", "angles")
    }
    content["alarms"] = {name: alarm.summary() for name, alarm in report.alarms.items()}
    content["origin"] = None if report.origin is None else spelled(report.origin)
    return {**about, "mean_interval": report.mean_interval, **content}


def as_table(report: DataReport, period: float) -> str:
    """A few lines for a terminal: only what there is to tell."""
    lines = [("rows read", f"{report.rows}")]
    if report.left_out:
        listed = ", ".join(f"{count} {reason}" for reason, count in report.left_out.items())
        lines.append(("lines left out", listed))
    if report.first is not None and report.last is not None:
        since = "" if report.origin is None else f" after {spelled(report.origin)}"
        lines.append(("time", f"{_time(report.first)} to {_time(report.last)} s{since}"))
    if report.mean_interval is not None:
        text = f"{period:g} s, timestamps say {report.mean_interval:.6g} s on average"
        lines.append(("sampling period", text))
        if report.jitter > 1e-9:
            lines.append(("largest jitter", f"{100 * report.jitter:.3g} % of a period"))
    for name, value in (
        ("samples lost", report.lost),
        ("timestamps repeated, left out", report.repeated),
        ("rows without timestamp, left out", report.unstamped),
        ("rows before all is measured", report.before_start),
        ("rows after all was measured", report.after_end),
    ):
        if value:
            lines.append((name, str(value)))
    for name, table in (
        ("values missing", report.missing),
        ("values filled", report.filled),
        ("values saturated", report.saturated),
        ("outliers beyond the gate", report.outliers),
    ):
        if table:
            listed = ", ".join(f"{column} {count}" for column, count in table.items())
            lines.append((name, listed))
    for start, end in report.gaps[:5]:
        begun = "the start" if start is None else f"{_time(start)} s"
        ending = "the end" if end is None else f"{_time(end)} s"
        lines.append(("gap", f"{begun} to {ending}"))
    if report.gap_count > 5:
        lines.append(("gaps in all", str(report.gap_count)))
    if report.restarts:
        lines.append(("restarts", str(report.restarts)))
    listed = ", ".join(f"{count} {word}" for word, count in report.statuses.items())
    lines.append(("estimates", f"{report.estimates}" + (f": {listed}" if listed else "")))
    for name, alarm in report.alarms.items():
        lines.append((f"alarm {name}", _alarm_line(alarm)))
        lines += [("", _size(one, alarm.unit)) for one in alarm.summary()["intervals"][:5]]
    width = max(len(name) for name, _ in lines)
    said = [f"  {name:<{width}}  {value}" for name, value in lines]
    return "\n".join(said + [f"  warning: {warning}" for warning in report.warnings])


def _time(seconds: float) -> str:
    """Six digits, or milliseconds where timestamps count from 1970."""
    return f"{seconds:.6g}" if abs(seconds) < 1e6 else f"{seconds:.3f}"


def _alarm_line(alarm: AlarmReport) -> str:
    said = _threshold(alarm)
    if not said:
        if alarm.ready:
            return f"no threshold: {alarm.learned} values in the stretch that sets it, 2 needed"
        return "no threshold yet: the record ends before the stretch that sets it does"
    if alarm.start_up:
        said += f"; start-up {_time(alarm.start_up)} s"
        if alarm.hidden:
            said += f", in which {alarm.hidden} rows are beyond it and raise no alarm"
    if alarm.after_gap:
        said += f"; {alarm.after_gap} rows beyond it in or after gaps, as the observer predicts"
    if alarm.first is None:
        return f"none; {said}"
    found = alarm.summary()["interval_count"]
    times = "once" if found == 1 else f"{found} times"
    first = f"first at {_time(alarm.first)} s"
    if alarm.earlier is not None:
        first += f" or earlier (beyond the threshold from {_time(alarm.earlier)} s on, in start-up)"
    return f"{times}, {alarm.rows} rows, {first}; {said}"


def _threshold(alarm: AlarmReport) -> str:
    """The threshold in words, nothing if it is not known."""
    parts = [
        f"{side} {_amount(value, alarm.unit)}"
        for side, value in (("above", alarm.above), ("below", alarm.below)) if value is not None
    ]  # fmt: skip
    if alarm.threshold is not None:
        parts.append(_amount(alarm.threshold, alarm.unit))
    if alarm.learns and parts:
        parts[0] += f" from the mean {alarm.mean:.4g}, both of {alarm.learned} values"
    said = " or ".join(parts)
    if alarm.sigmas is not None:
        by = f"{alarm.sigmas:g} standard deviations of the observer"
        said = by if alarm.threshold == 0.0 else f"{said} by {by}"
    return f"threshold {said}" if said else ""


def _size(interval: Mapping[str, Any], unit: str) -> str:
    """The time and size of an excess."""
    said = f"{_time(interval['start'])} to {_time(interval['end'])} s: mean "
    said += _amount(interval["mean"], unit)
    if interval["standard_deviation"] is not None:
        said += f", standard deviation {interval['standard_deviation']:.2g}"
    if interval["sigma"] is not None:
        said += f" (by the observer {interval['sigma']:.2g})"
    return f"{said}, peak {_amount(interval['peak'], unit)}"


def _amount(value: float, unit: str) -> str:
    return f"{value:.4g} {unit if unit != '1' else ''}".rstrip()
