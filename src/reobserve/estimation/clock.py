"""The clock of a record: its cells of dates or numbers as seconds, without loss of digits.

Times count from the second in which the record begins, where they are dates or numbers so large
that seconds since zero would lose digits, as those since 1970.

Where clocks are put back, an hour of local times occurs twice. The order of the rows says which
one is meant:

    02:50, 02:55, 02:00, 02:05, ...
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from decimal import Decimal
from typing import Any

from reobserve.core.errors import InputError, shown
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dates import (
    SECOND,
    SPELLED_DURATION,
    moment,
    of_nanoseconds,
    offset_of,
    since_1970,
    spelled,
    time_zone,
)
from reobserve.estimation.quantities import Conversion

_LARGE = 1e6  # [s], of which seconds have 10 digits behind the point


class SkippedTimeError(ValueError):
    """A local time that does not occur, as clocks were put forward."""


@dataclass
class Dates:
    """The way dates are written.

    Parameters
    ----------
    format
        As strptime reads it, or nothing for ISO 8601.
    zone
        The time zone of dates without an offset, or nothing for UTC.
    period
        The sampling period [s].
    day
        Of the first row, if the format has times of day alone.
    floating
        True once a date without an offset was read as one of UTC, though nobody stated it.
    """

    format: str = ""
    zone: str = ""
    period: float = 0.0
    day: str = ""
    floating: bool = False

    def seconds(self, text: str, where: str, place: str, report: DataReport) -> float:
        """The time [s] of a date.

        Messages call the record ``place``, and the cells ``where``.
        """
        try:
            return report.clock(self.nanoseconds(text, report))
        except SkippedTimeError:
            problem = f"{where} is {shown(text)}, which clocks in {self.zone} skip"
        except ValueError:
            wanted = f"by columns.time.format, {self.format}" if self.format else (
                "with a time, as 2026-03-29T01:59:58Z, or without; columns.time.format states "
                "another form"
            )  # fmt: skip
            if SPELLED_DURATION.fullmatch(text):
                wanted += "; of a duration columns.time.unit is duration"
            problem = f"{where} is {shown(text)}, must be a date {wanted}"
        raise InputError(place, problem)

    def nanoseconds(self, text: str, report: DataReport) -> int:
        """Nanoseconds since 1970 of a date (raises ValueError if it is none)."""
        date = moment(text, self.format)
        if self.day:
            date = self._on_its_day(date, report)
        if date.tzinfo is None:
            return self.local(date, report)
        if report.origin is None:
            offset = offset_of(date)
            report.zone = self.zone or (offset if len(offset) == 6 and date.utcoffset() else "UTC")
        return since_1970(date)

    def at(self, place: str, when: float | str, report: DataReport) -> float:
        """The time [s] of the record at a stated date, or so many seconds after its beginning."""
        if not isinstance(when, str):
            return when
        for form in dict.fromkeys(["" if self.day else self.format, ""]):
            with suppress(ValueError):
                date = moment(when, form)
                zone = time_zone(self.zone or "UTC")
                return report.since_origin(since_1970(
                    date if date.tzinfo is not None else date.replace(tzinfo=zone)
                ))  # fmt: skip
        problem = f"{shown(when)} must be a date, as {spelled(0, report.zone)}, or seconds"
        raise InputError(place, problem)

    def _on_its_day(self, time: datetime, report: DataReport) -> datetime:
        """A time of day on the day on which it is nearest to the rows of the report."""
        if report.latest is None:
            return datetime.combine(datetime.fromisoformat(self.day), time.time())
        last = of_nanoseconds(report.latest * 1000).astimezone(time_zone(self.zone or "UTC"))
        last = last.replace(tzinfo=None)
        date, half = datetime.combine(last, time.time()), timedelta(hours=12)
        return date + timedelta(days=(last - date > half) - (date - last > half))

    def local(self, date: datetime, report: DataReport) -> int:
        """Nanoseconds since 1970 of a date without an offset, after the rows of the report."""
        if not self.zone:
            self.floating = True
            return since_1970(date.replace(tzinfo=UTC))
        report.zone = self.zone
        zone = time_zone(self.zone)
        first, second = (since_1970(date.replace(tzinfo=zone, fold=fold)) for fold in (0, 1))
        if first == second:
            return first
        if first > second:
            raise SkippedTimeError
        last = None if report.latest is None else report.latest * 1000
        period = self.period * SECOND
        if last is None or first - last > 2.0 * period:
            report.warn(
                f"in {self.zone}, times about {date:%Y-%m-%d %H}:00 occur twice, and the record "
                "does not say which is meant: the first is assumed"
            )
            return first
        if first == last:  # a timestamp that stands still, or goes on by an hour
            return second if period > 0.5 * (second - first) else first
        return first if first > last else second


@dataclass(frozen=True)
class Clock:
    """The columns of timestamps, by their ``titles``: ``dates``, or numbers with a conversion.

    The cells of several columns make a date, with a blank between them. If time has ``elapsed``,
    the numbers are those of seconds in durations.
    """

    titles: tuple[str, ...]
    way: Conversion
    dates: Dates | None = None
    elapsed: bool = False

    def begin(self, number: float, report: DataReport) -> None:
        """Settle the second that times count from, by the first number."""
        if report.shift is None and math.isfinite(number):
            first = float(self.way.of(number))
            whole = max(1, round(self.way.factor))  # seconds of a unit
            report.shift = math.floor(first / whole) * whole if abs(first) >= _LARGE else 0

    def epoch(self, report: DataReport) -> int:
        """The number that times count from."""
        return round((report.shift or 0) / self.way.factor)

    def exact(self, number: Any, report: DataReport) -> float:
        """A number, as text or as it is, less what times count from (raises ValueError if none)."""
        try:
            return float(Decimal(number) - self.epoch(report))
        except ArithmeticError:
            raise ValueError from None
