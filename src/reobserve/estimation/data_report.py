"""The data report: what was done to a record and what the alarms found, as a table and as JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any

from reobserve.estimation.dates import SECOND, spelled

_FAST = 1e-5  # [s], of which microseconds are not enough
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

    def add(self, value: float, sigma: float | None, normal: float) -> None:
        """Take a value, by Welford's sums."""
        self.values += 1
        off = value - self.mean
        self.mean += off / self.values
        self.squares += off * (value - self.mean)
        if sigma is not None:
            self.variances = (self.variances or 0.0) + sigma**2
        if self.values == 1 or abs(value - normal) > abs(self.peak - normal):
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

    ``start_up`` [s] after each start of the observer, at ``started``, it is not raised. ``current``
    is the latest interval, ``waiting`` values with their sigmas belong to it if it goes on.
    """

    unit: str
    start_up: float
    learns: bool = False
    threshold: float | None = None
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
        return {
            "unit": self.unit, "threshold": self.threshold, **learned, "start_up": self.start_up,
            "rows": self.rows, "first": self.first,
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
    or before the first one. ``latest`` [us since 1970] is the last date, and ``zone`` that of the
    clocks by which dates are spelled, or nothing if they have no offset. If timestamps are large
    numbers, times count from ``shift`` [s]; None before the first of them.
    """

    period: float = 1.0  # of sampling [s]
    rows: int = 0
    first: float | None = None
    last: float | None = None
    intervals: int = 0
    single: int = 0  # intervals of one period
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
    origin: int | None = None
    left_out: dict[str, int] = field(default_factory=dict)
    latest: int | None = None
    shift: int | None = None
    zone: str = ""

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
        """[s], over all intervals."""
        slots = self.intervals + self.lost
        if self.first is None or self.last is None or not slots:
            return None
        return (self.last - self.first) / slots


_INTERNAL = ("single", "angles", "levels", "filling", "latest", "shift", "origin", "period")
_TIMES = ("first", "last", "gaps", "start", "end")


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


def as_table(report: DataReport, period: float) -> str:
    """A few lines for a terminal: only what there is to tell."""
    lines = [("rows read", f"{report.rows}")]
    if report.left_out:
        listed = ", ".join(f"{count} {reason}" for reason, count in report.left_out.items())
        lines.append(("lines left out", listed))

    def at(seconds: float) -> str:
        if report.origin is not None:
            return report.said(seconds)
        return f"{_time(seconds + (report.shift or 0))} s"

    if report.first is not None and report.last is not None:
        lines.append(("time", _span(at(report.first), at(report.last))))
    if report.mean_interval is not None:
        text = f"{period:g} s, timestamps say {report.mean_interval:.6g} s on average"
        lines.append(("sampling period", text))
        if 1e-9 < report.jitter < 0.5:  # of rows that have places
            lines.append(("largest jitter", f"{100 * report.jitter:.3g} % of a period"))
    for name, value in (
        ("samples lost", report.lost),
        ("timestamps repeated", report.repeated),
        ("rows without timestamp, left out", report.unstamped),
        ("rows before all is measured", report.before_start),
        ("rows after all was measured", report.after_end),
    ):
        if value:
            lines.append((name, str(value)))
    for name, table in (
        ("values missing", report.missing),
        ("values filled", report.filled),
        ("values held until they change", report.held),
        ("values saturated", report.saturated),
        ("outliers beyond the gate", report.outliers),
    ):
        if table:
            listed = ", ".join(f"{column} {count}" for column, count in table.items())
            lines.append((name, listed))
    for start, end in report.gaps[:5]:
        begun = "the start" if start is None else at(start)
        ending = "the end" if end is None else at(end)
        lines.append(("gap", f"{begun} to {ending}"))
    if report.gap_count > 5:
        lines.append(("gaps in all", str(report.gap_count)))
    if report.restarts:
        lines.append(("restarts", str(report.restarts)))
    listed = ", ".join(f"{count} {word}" for word, count in report.statuses.items())
    lines.append(("estimates", f"{report.estimates}" + (f": {listed}" if listed else "")))
    for name, alarm in report.alarms.items():
        lines.append((f"alarm {name}", _alarm_line(alarm, at)))
        lines += [("", _size(one, alarm.unit, at)) for one in alarm.summary()["intervals"][:5]]
    width = max(len(name) for name, _ in lines)
    said = [f"  {name:<{width}}  {value}" for name, value in lines]
    return "\n".join(said + [f"  warning: {warning}" for warning in report.warnings])


def _time(seconds: float) -> str:
    """Six digits, or milliseconds where timestamps count from 1970."""
    return f"{seconds:.6g}" if abs(seconds) < 1e6 else f"{seconds:.3f}"


def _span(start: str, end: str) -> str:
    """From one time to another, in seconds if the second one is."""
    return f"{start.removesuffix(' s') if end.endswith(' s') else start} to {end}"


def _alarm_line(alarm: AlarmReport, at: Callable[[float], str]) -> str:
    if alarm.threshold is None:
        if alarm.ready:
            return f"no threshold: {alarm.learned} values in the stretch that sets it, 2 needed"
        return "no threshold yet: the record ends before the stretch that sets it does"
    said = f"threshold {_amount(alarm.threshold, alarm.unit)}"
    if alarm.learns:
        said += f" from the mean {alarm.mean:.4g}, both of {alarm.learned} values"
    if alarm.start_up:
        said += f"; start-up {_time(alarm.start_up)} s"
    if alarm.first is None:
        return f"none; {said}"
    found = alarm.summary()["interval_count"]
    times = "once" if found == 1 else f"{found} times"
    return f"{times}, {alarm.rows} rows, first at {at(alarm.first)}; {said}"


def _size(interval: Mapping[str, Any], unit: str, at: Callable[[float], str]) -> str:
    """The time and size of an excess."""
    said = f"{_span(at(interval['start']), at(interval['end']))}: mean "
    said += _amount(interval["mean"], unit)
    if interval["standard_deviation"] is not None:
        said += f", standard deviation {interval['standard_deviation']:.2g}"
    if interval["sigma"] is not None:
        said += f" (by the observer {interval['sigma']:.2g})"
    return f"{said}, peak {_amount(interval['peak'], unit)}"


def _amount(value: float, unit: str) -> str:
    return f"{value:.4g} {unit if unit != '1' else ''}".rstrip()
