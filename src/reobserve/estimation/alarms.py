"""Alarms: columns against thresholds that are stated or learned, and the intervals they cover.

While the observer forgets how it started, its estimates are off and raise no alarm. This start-up
is stated, or derived from the observer: the time in which its response to a unit impulse in the
first row of a measurement, the largest over all of them, falls below a hundredth of its peak in
the rows after that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, ReobserveError, nearest
from reobserve.estimation.data_report import AlarmReport, DataReport, Interval
from reobserve.estimation.detector_alarms import DetectorAlarm, DetectorRule, detector_alarm
from reobserve.estimation.outputs import Output
from reobserve.estimation.specification import LearnedThreshold, StatedThreshold

Array = NDArray[np.float64]

FEW = 20  # values, whose standard deviation is itself off by a sixth
QUIET = 10.5  # periods without an alarm, after which an interval has ended
_ROUNDING = 1e-9
_DECAYED = 0.01
_SHORTEST, _LONGEST = 64, 4096  # rows over which an impulse response is followed
_SAMPLES = 100  # of start-up where the response does not decay, or there is none


@dataclass
class Alarm:
    """An alarm on a column. ``deviation`` is that of its standard deviation, if there is one."""

    rule: StatedThreshold | LearnedThreshold
    column: int
    deviation: int | None
    period: float

    @property
    def name(self) -> str:
        """The alarm's name as the user calls it."""
        return self.rule.name

    def threshold(self, found: AlarmReport) -> float | None:
        """The distance from the mean that a value may have, or None before it is known."""
        if isinstance(self.rule, StatedThreshold):
            return self.rule.above
        if not found.ready or found.learned < 2:
            return None
        return self.rule.sigma * float(np.sqrt(found.squares / (found.learned - 1)))

    def raised(
        self, time: Array, numbers: Array, report: DataReport, estimates: Mapping[str, Array]
    ) -> Array:
        """1 where the alarm is raised, 0 where not, nan where it cannot be known yet.

        ``numbers`` are those of all columns, shape (k, columns).
        """
        found, values = report.alarms[self.name], numbers[:, self.column]
        if isinstance(self.rule, StatedThreshold):
            raised = np.where(np.isnan(values), 0.0, np.abs(values) > self.rule.above)
        else:
            raised = self._learned(time, values, self.rule, found)
            if found.threshold is not None and found.learned < FEW:
                report.warn(
                    f"alarm {self.name}: its threshold is learned from {found.learned} values, "
                    f"fewer than {FEW}; a longer stretch of rows that are measured sets it well"
                )
        slack = _ROUNDING * found.start_up
        raised[time - (found.started or 0.0) < found.start_up - slack] = np.nan
        if found.current is not None or (raised == 1.0).any():
            deviations = None if self.deviation is None else numbers[:, self.deviation]
            follow(time, values, deviations, raised, found, self.period)
        return raised

    def _learned(
        self, time: Array, values: Array, rule: LearnedThreshold, found: AlarmReport
    ) -> Array:
        if found.origin is None:
            found.origin = float(time[0])
        past = time - found.origin
        raised = np.full(len(values), np.nan)
        slack = _ROUNDING * rule.until
        after = past > rule.until + slack
        for value in values[~after & (past >= rule.since - slack)].tolist():
            if value == value:  # noqa: PLR0124  # not nan
                found.learned += 1
                off = value - found.mean
                found.mean += off / found.learned
                found.squares += off * (value - found.mean)
        if after.any():
            found.ready = True
            found.threshold = self.threshold(found)
            if found.threshold is not None:
                off_mean = np.abs(values[after] - found.mean)
                raised[after] = np.where(np.isnan(off_mean), 0.0, off_mean > found.threshold)
        return raised


def follow(
    time: Array, values: Array, deviations: Array | None, raised: Array, found: AlarmReport,
    period: float,
) -> None:  # fmt: skip
    """Add rows to intervals: interruptions that are shorter than ten periods belong to them."""
    for k in range(len(time)):
        now, on, one = float(time[k]), raised[k] == 1.0, found.current
        if one is not None and now - one.end > QUIET * period:
            found.close()
            one = None
        if on and one is None:
            one = found.current = Interval(now, now)
            found.first = now if found.first is None else found.first
        if one is not None and not np.isnan(values[k]):
            sigma = None if deviations is None else float(deviations[k])
            found.waiting.append([float(values[k]), sigma])
        if on and one is not None:
            found.rows += 1
            one.end = now
            for value, sigma in found.waiting:
                assert value is not None
                one.add(value, sigma, found.mean)
            found.waiting.clear()


def alarms(
    rules: Sequence[StatedThreshold | LearnedThreshold | DetectorRule],
    columns: Sequence[Output],
    report: DataReport,
    period: float,
    start_up: Callable[[int], float],
    measurements: Sequence[str],
    sample: Any,
    skips: bool,
) -> list[Alarm | DetectorAlarm]:
    """The alarms of a specification, each with its place in the report.

    ``start_up`` gives that of a column [s], for alarms that state none; ``sample`` are estimates of
    a row, ``measurements`` the names of these, and ``skips`` says that a gate leaves some out.

    Raises
    ------
    InputError
        If a column is not among those that are written.
    """
    names = [column.name for column in columns]
    made: list[Alarm | DetectorAlarm] = []
    for k, rule in enumerate(rules):
        if isinstance(rule, DetectorRule):
            made.append(detector_alarm(rule, k, period, measurements, sample, skips))
            report.alarms[rule.name] = AlarmReport("1", 0.0)
            continue
        if rule.of not in names:
            raise InputError(
                f"alarms.{k}.of", f"there is no column {rule.of!r}{nearest(rule.of, names)}"
            )
        place = names.index(rule.of)
        beside = place + 1
        spread = beside < len(columns) and columns[beside].deviation
        alarm = Alarm(rule, place, beside if spread else None, period)
        ignored = start_up(place) if rule.start_up is None else rule.start_up
        found = AlarmReport(columns[place].unit, ignored, learns=isinstance(rule, LearnedThreshold))
        found.threshold = alarm.threshold(found)
        report.alarms[rule.name] = found
        made.append(alarm)
    return made


def start_up(run: Callable[[Array], Array], measurements: int, columns: int) -> NDArray[np.int_]:
    """The number of rows that each column needs to forget an impulse in the first measurements.

    ``run`` gives them, shape (k, ``columns``), for measurements, shape (k, ``measurements``).
    """
    rows = _SHORTEST
    while True:
        silence = np.zeros((rows, measurements))
        try:
            base = run(silence)
            response = np.zeros(base.shape)
            for sensor in range(measurements):
                silence[0, sensor] = 1.0
                response = np.fmax(response, np.abs(run(silence) - base))
                silence[0, sensor] = 0.0
        except ReobserveError:  # where nothing moves, not every observer can run
            return np.full(columns, _SAMPLES)
        moved = response.any(axis=0)
        response[0] = 0.0  # where a residual is the impulse itself
        over = response > _DECAYED * response.max(axis=0)
        last: NDArray[np.int_] = np.where(over.any(axis=0), rows - np.argmax(over[::-1], axis=0), 1)
        last[~moved] = _SAMPLES
        if (last <= rows // 2).all() or rows == _LONGEST:
            last[last > _LONGEST // 2] = _SAMPLES
            return last
        rows *= 2
