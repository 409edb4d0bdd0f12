"""Alarms: columns against thresholds that are stated, or learned on a stretch that is stated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, nearest
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.outputs import Output
from reobserve.estimation.specification import LearnedThreshold, StatedThreshold

Array = NDArray[np.float64]

_ROUNDING = 1e-9
FEW = 20  # values, whose standard deviation is itself off by a sixth


@dataclass
class Alarm:
    """One alarm on a column; Welford's sums run over the stretch that sets its threshold."""

    rule: StatedThreshold | LearnedThreshold
    column: int
    unit: str
    origin: float | None = None  # the time of the first estimate
    learned: int = 0
    mean: float = 0.0
    squares: float = 0.0
    ready: bool = False

    @property
    def name(self) -> str:
        """As the user calls it."""
        return self.rule.name

    @property
    def threshold(self) -> float | None:
        """How far a value may be off the mean; None before it is known."""
        if isinstance(self.rule, StatedThreshold):
            return self.rule.above
        if not self.ready or self.learned < 2:
            return None
        return self.rule.sigma * float(np.sqrt(self.squares / (self.learned - 1)))

    def raised(self, time: Array, values: Array, report: DataReport) -> Array:
        """1 where the alarm is raised, 0 where not, nan where it is not known yet."""
        if isinstance(self.rule, StatedThreshold):
            found = np.where(np.isnan(values), 0.0, np.abs(values) > self.rule.above)
        else:
            found = self._learned(time, values, self.rule)
        told = report.alarms.setdefault(
            self.name, {"rows": 0, "first": None, "unit": self.unit, "mean": None}
        )
        told["threshold"] = self.threshold
        if isinstance(self.rule, LearnedThreshold):
            told["learned"], told["ready"] = self.learned, self.ready
            if self.threshold is not None:
                told["mean"] = self.mean
                if self.learned < FEW:
                    report.warn(
                        f"alarm {self.name}: its threshold is learned from {self.learned} values, "
                        f"fewer than {FEW}; a longer stretch of rows that are measured sets it well"
                    )
        rows = np.flatnonzero(found == 1.0)
        told["rows"] += len(rows)
        if len(rows) and told["first"] is None:
            told["first"] = float(time[rows[0]])
        return found

    def _learned(self, time: Array, values: Array, rule: LearnedThreshold) -> Array:
        if self.origin is None:
            self.origin = float(time[0])
        past = time - self.origin
        found = np.full(len(values), np.nan)
        slack = _ROUNDING * rule.until
        after = past > rule.until + slack
        for value in values[~after & (past >= rule.since - slack)].tolist():
            if value == value:  # noqa: PLR0124  # not nan
                self.learned += 1
                off = value - self.mean
                self.mean += off / self.learned
                self.squares += off * (value - self.mean)
        if after.any():
            self.ready = True
            threshold = self.threshold
            if threshold is not None:
                off_mean = np.abs(values[after] - self.mean)
                found[after] = np.where(np.isnan(off_mean), 0.0, off_mean > threshold)
        return found


def alarms(
    rules: Sequence[StatedThreshold | LearnedThreshold], columns: Sequence[Output]
) -> list[Alarm]:
    """The alarms of a specification.

    Raises
    ------
    InputError
        If a column is not among those that are written.
    """
    names = [column.name for column in columns]
    made = []
    for k, rule in enumerate(rules):
        if rule.of not in names:
            raise InputError(
                f"alarms.{k}.of", f"there is no column {rule.of!r}{nearest(rule.of, names)}"
            )
        place = names.index(rule.of)
        made.append(Alarm(rule, place, columns[place].unit))
    return made
