"""Alarms: columns against thresholds that are stated or learned, and the intervals they cover.

While the observer forgets how it started, `reobserve.estimation.start_up`, its estimates are off.
They raise no alarm then, except beyond a threshold by five of their own standard deviations, and
only as long as all innovations are within five of those that were predicted: else the start was
less certain than stated.

In a gap, a filter predicts larger standard deviations. Until they are again within a fourth of what
they were before, a threshold of a residual that is not stated in them grows as they do, and an
estimate raises an alarm only beyond its threshold by five of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, nearest, shown
from reobserve.estimation.clock import Dates
from reobserve.estimation.data_report import QUIET, AlarmReport, DataReport, follow
from reobserve.estimation.detector_alarms import (
    BLIND,
    PREDICTING,
    DetectorAlarm,
    DetectorRule,
    detector_alarm,
)
from reobserve.estimation.output_columns import RESIDUAL
from reobserve.estimation.specification import LearnedThreshold, StatedThreshold
from reobserve.estimation.start_up import NEAR

if TYPE_CHECKING:
    from reobserve.estimation.estimate import Estimation

Array = NDArray[np.float64]

FEW = 20  # values, whose standard deviation is itself off by a sixth
_ROUNDING = 1e-9
_CREDIBLE = 5.0  # standard deviations beyond a threshold, which raise an alarm in the start-up


@dataclass
class Alarm:
    """An alarm on a column. ``deviation`` is that of its standard deviation, if there is one.

    ``residual`` is the measurement whose residual the column is, and ``predicts`` says that the
    observer predicts its variance.
    """

    rule: StatedThreshold | LearnedThreshold
    column: int
    deviation: int | None
    period: float
    residual: int | None = None
    predicts: bool = False
    dates: Dates | None = None
    stretch: Sequence[float] = ()  # that sets a threshold, after the first estimate [s]

    def raised(
        self, time: Array, numbers: Array, report: DataReport, estimates: Mapping[str, Array]
    ) -> Array:
        """1 where the alarm is raised, 0 where not, nan where it cannot be known yet.

        ``numbers`` are those of all columns, shape (k, columns).
        """
        entry, values = report.alarms[self.rule.name], numbers[:, self.column]
        sigmas, missing = self._sigmas(numbers, estimates), self._missing(values, estimates)
        grown = None
        if sigmas is not None and entry.sigmas is None:
            grown = _grown(missing, sigmas, entry)
        ready = self._learned(time, values, grown, report)
        scale = 1.0 if grown is None or self.residual is None else grown
        excess = _excess(values, scale, entry)
        margin = 0.0 if entry.sigmas is None or sigmas is None else entry.sigmas * sigmas
        raised = (excess > margin).astype(np.float64)
        if grown is not None and sigmas is not None:
            self._doubt(values, excess, raised, grown, sigmas, entry)
        if ready is not None:
            raised[~ready] = np.nan
        shown = sigmas if self.residual is None else None
        any_raised = bool((raised == 1.0).any())
        if any_raised or time[0] - (entry.started or 0.0) < entry.start_up:
            self._start_up(time, raised, excess, shown, report, estimates)
        if sigmas is None:
            self._unknown_after_gap(time, missing, raised, report)
        if entry.current is not None or any_raised:
            follow(time, values, shown, raised, entry, self.period)
        return raised

    def _missing(self, values: Array, estimates: Mapping[str, Array]) -> NDArray[np.bool_]:
        """True where a measurement on which the column depends is missing."""
        if self.residual is not None or "innovation" not in estimates:
            return np.isnan(values)
        lost = np.isnan(estimates["innovation"]).reshape(len(values), -1)
        return np.asarray(lost.any(axis=1))

    def _doubt(
        self, values: Array, excess: Array, raised: Array, grown: Array, sigmas: Array,
        entry: AlarmReport,
    ) -> None:  # fmt: skip
        """Count what is beyond a threshold only since a gap, and is no reason for an alarm."""
        beyond = _excess(values, 1.0, entry) > 0.0
        if self.residual is None:
            raised[beyond & (grown > 1.0) & (excess <= _CREDIBLE * sigmas)] = np.nan
        entry.after_gap += int(np.count_nonzero(beyond & (raised != 1.0)))

    def _sigmas(self, numbers: Array, estimates: Mapping[str, Array]) -> Array | None:
        """The standard deviations that the observer has for the column, if it has any."""
        if self.predicts and self.residual is not None:
            return np.sqrt(estimates["innovation_covariance"][:, self.residual, self.residual])
        return None if self.deviation is None else numbers[:, self.deviation]

    def _start_up(
        self, time: Array, raised: Array, excess: Array, sigmas: Array | None, report: DataReport,
        estimates: Mapping[str, Array],
    ) -> None:  # fmt: skip
        """Raise no alarm in the start-up unless it is credible, and remember what was beyond."""
        entry = report.alarms[self.rule.name]
        past = time - (entry.started or 0.0)
        within = past < entry.start_up - _ROUNDING * entry.start_up
        over = within & (raised == 1.0)
        if self.rule.start_up is not None or sigmas is None:
            credible = np.zeros(len(time), dtype=bool)
        else:
            credible = over & (excess > _CREDIBLE * sigmas)
            if self.predicts:
                credible &= ~_surprised(within, estimates, entry)
        raised[within & ~credible] = np.nan
        entry.ignored += int(np.count_nonzero(within & ~credible))
        entry.hidden += int(np.count_nonzero(over & ~credible))
        first = entry.first
        for k in np.flatnonzero(over | (raised == 1.0)):
            now = float(time[k])
            separate = not entry.beyond or now - entry.beyond[1] > QUIET * self.period
            if raised[k] == 1.0 and first is None:
                first = now
                if not separate and entry.beyond[0] < now:
                    entry.earlier = entry.beyond[0]
                    report.warn(
                        f"alarm {self.rule.name}: its threshold was exceeded already within the "
                        f"start-up of {entry.start_up:g} s, so that it may have begun before its "
                        "first row"
                    )
            if not within[k]:
                break
            entry.beyond = [now if separate else entry.beyond[0], now]

    def _unknown_after_gap(
        self, time: Array, missing: NDArray[np.bool_], raised: Array, report: DataReport
    ) -> None:
        """Warn of alarms in or soon after a gap, if no standard deviation says what to expect."""
        entry = report.alarms[self.rule.name]
        quiet = entry.resumed is None or not (raised == 1.0).any()
        near = entry.seen is not None and time[-1] - entry.seen <= QUIET * self.period
        if quiet and near and not missing.any():  # as nearly all rows that come alone
            entry.seen = float(time[-1])
            return
        soon, seen, long = 0, entry.seen, QUIET * self.period
        for now, lost, on in zip(
            time.tolist(), missing.tolist(), (raised == 1.0).tolist(), strict=True
        ):
            in_gap = seen is not None and now - seen > long
            if not lost:
                entry.resumed, seen = now if in_gap else entry.resumed, now
            since = math.inf if entry.resumed is None else now - entry.resumed
            soon += on and (in_gap or since < max(entry.start_up, long))
        entry.seen = seen
        entry.after_gap += soon
        if soon:
            report.warn(
                f"alarm {self.rule.name}: it is raised in a gap or soon after, and the observer "
                "has no standard deviation of its column; with sampling.at_gap: restart it is not "
                "raised until the observer has started up, and filters that have one "
                f"({PREDICTING}) take sigmas"
            )

    def stretch_of(self, place: str, first: float, report: DataReport) -> list[float]:
        """The ends of the stretch that sets a threshold, in seconds after the first estimate."""
        ends = []
        for key in ("since", "until"):
            bound, at = getattr(self.rule, key), f"{place}{key}"
            if not isinstance(bound, str):
                ends.append(float(bound))
            elif self.dates is not None:
                ends.append(self.dates.at(at, bound, report) - first)
            else:
                problem = f"{shown(bound)} must be seconds, as the record has no dates"
                raise InputError(at, problem)
        return ends

    def _learned(
        self, time: Array, values: Array, grown: Array | None, report: DataReport
    ) -> NDArray[np.bool_] | None:
        """Learn a threshold that is to be learned: True where it is known, None if all are."""
        rule, entry = self.rule, report.alarms[self.rule.name]
        if isinstance(rule, StatedThreshold):
            return None
        if entry.origin is None:
            entry.origin = float(time[0])
        place = f"alarms: {rule.name}: "
        self.stretch = self.stretch or self.stretch_of(place, entry.origin, report)
        since, until = self.stretch
        if not since < until or until < 0.0:
            problem = f"{rule.until} must be after since, {rule.since}, and after the first row"
            raise InputError(f"{place}until", problem)
        past, slack = time - entry.origin, _ROUNDING * until
        after: NDArray[np.bool_] = past > until + slack
        if not entry.ready:
            taken = ~after & (past >= since - slack)
            if grown is not None:
                taken &= grown == 1.0
            for value in values[taken].tolist():
                if value == value:  # noqa: PLR0124  # not nan
                    entry.learned += 1
                    off = value - entry.mean
                    entry.mean += off / entry.learned
                    entry.squares += off * (value - entry.mean)
            if after.any():
                entry.ready = True
                if entry.learned > 1:
                    deviation = np.sqrt(entry.squares / (entry.learned - 1))
                    entry.threshold = rule.sigma * float(deviation)
        if entry.threshold is None:
            return np.zeros(len(time), dtype=bool)
        if entry.learned < FEW:
            report.warn(
                f"alarm {self.rule.name}: its threshold is learned from {entry.learned} values, "
                f"fewer than {FEW}; a longer stretch of rows that are measured sets it well"
            )
        return None if after.all() else after


def _excess(values: Array, grown: Array | float, entry: AlarmReport) -> Array:
    """The distance of values beyond a threshold that has grown, negative on this side of it."""
    if entry.threshold is None and entry.above is None:
        excess = np.full(len(values), -np.inf)
    elif entry.threshold is not None:
        excess = np.abs(values - entry.mean) - grown * entry.threshold
    else:
        assert entry.above is not None
        excess = values - entry.above - abs(entry.above) * (grown - 1.0)
    if entry.below is not None:
        low = entry.below - values - abs(entry.below) * (grown - 1.0)
        excess = np.maximum(excess, low)
    return excess  # of what is missing, nan, which exceeds nothing


def _surprised(
    within: NDArray[np.bool_], estimates: Mapping[str, Array], entry: AlarmReport
) -> NDArray[np.bool_]:
    """True from the first row of a start-up on that contradicts what the filter predicted."""
    variances = estimates["innovation_covariance"].diagonal(axis1=-2, axis2=-1)
    off = np.abs(estimates["innovation"]) > _CREDIBLE * np.sqrt(variances)
    surprised = np.logical_or.accumulate(off.any(axis=1) & within) | entry.surprised
    entry.surprised = bool(surprised[-1])
    return surprised


def _grown(missing: NDArray[np.bool_], sigmas: Array, entry: AlarmReport) -> Array | None:
    """Standard deviations relative to those before a gap, None without a gap."""
    if entry.before_gap is None and not missing.any():
        entry.settled = float(sigmas[-1])
        return None
    grown = np.ones(len(sigmas))
    for k, sigma in enumerate(sigmas.tolist()):
        if missing[k]:
            entry.before_gap, entry.near = entry.before_gap or entry.settled, 0
        if entry.before_gap is None:
            entry.settled = None if missing[k] else sigma
        elif sigma > NEAR * entry.before_gap:
            grown[k], entry.near = sigma / entry.before_gap, 0
        elif not missing[k]:  # with a constant gain, it may still swing
            entry.near += 1
            if entry.near > QUIET:
                entry.before_gap, entry.settled = None, sigma
    return grown


def alarms(estimation: Estimation) -> list[Alarm | DetectorAlarm]:
    """The alarms of an estimation, each with its place in the report.

    Raises
    ------
    InputError
        If there is no such column, or an alarm does not fit the observer or the record.
    """
    observer, outputs, report = estimation.observer, estimation.outputs, estimation.report
    dates, period = estimation.timestamps.dates, report.period
    timed, width = estimation.layout.timed, estimation.layout.measurements
    measurements = estimation.layout.names[timed : timed + width]
    predicts = estimation.design.residual_variance(estimation.sample) is not None
    gate, leaves_out = getattr(observer, "gate", None), "outlier" in estimation.sample
    skips = leaves_out and getattr(observer, "outliers", "skip") == "skip"
    columns = outputs.columns
    names = [column.name for column in columns]
    made: list[Alarm | DetectorAlarm] = []
    for k, rule in enumerate(estimation.specification.alarms):
        if isinstance(rule, DetectorRule):
            made.append(detector_alarm(rule, k, period, measurements, predicts, skips))
            report.alarms[rule.name] = AlarmReport("1", 0.0)
            continue
        place = _place(rule.of, f"alarms.{k}.of", names, predicts)
        residual, spread = columns[place].estimate == RESIDUAL, outputs.deviation_of(place)
        if residual and skips:
            raise InputError(f"alarms.{k}.of", f"{shown(rule.of)} {BLIND}")
        alarm = Alarm(
            rule, place, spread, period, columns[place].place if residual else None, predicts,
            dates,
        )  # fmt: skip
        entry = AlarmReport(columns[place].unit, 0.0, learns=isinstance(rule, LearnedThreshold))
        if isinstance(rule, StatedThreshold):
            entry.above, entry.below, entry.sigmas = rule.above, rule.below, rule.sigmas
            one_sided = rule.above is not None or rule.below is not None
            entry.threshold = None if one_sided else rule.beyond or 0.0
        else:
            alarm.stretch_of(f"alarms.{k}.", 0.0, DataReport())
        if entry.sigmas is not None and not (residual and predicts) and spread is None:
            problem = f"the observer has no standard deviation of {names[place]!r}"
            if residual:
                problem += f"; the kinds {PREDICTING} predict those of residuals"
            raise InputError(f"alarms.{k}.sigmas", problem)
        if residual and entry.sigmas is not None and gate is not None and entry.sigmas >= gate:
            problem = f"{entry.sigmas:g} must be below the gate, {gate:g}: outliers: inflate keeps "
            raise InputError(f"alarms.{k}.sigmas", f"{problem}all innovations within it")
        if rule.start_up is not None:
            entry.start_up = rule.start_up
        elif entry.sigmas is None:
            entry.start_up = estimation.start_up_of(place)
        report.alarms[rule.name] = entry
        made.append(alarm)
    return made


def _place(of: str, key: str, names: Sequence[str], predicts: bool) -> int:
    """The column of an alarm, which for the innovation of a measurement is its residual."""
    name = of
    if of not in names and of.startswith("innovation "):
        if not predicts:
            problem = (
                f"{of!r} is for filters that predict its variance ({PREDICTING}); others have "
            )
            raise InputError(key, f"{problem}residuals")
        name = of.replace("innovation", RESIDUAL, 1)
    if name not in names:
        raise InputError(key, f"there is no column {of!r}{nearest(of, names)}")
    return names.index(name)


def warn_of_start_up(report: DataReport) -> None:
    """Warn of alarms that could not be raised in more than a third of the rows."""
    for name, entry in report.alarms.items():
        if 3 * entry.ignored > report.estimates:
            report.warn(
                f"alarm {name}: it cannot be raised in {entry.ignored} of {report.estimates} rows, "
                f"its start-up of {entry.start_up:g} s; start_up states another, and sigmas "
                "(standard deviations that the observer has) need none"
            )
