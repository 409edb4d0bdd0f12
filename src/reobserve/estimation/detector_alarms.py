"""Alarms by detectors of `reobserve.detection`, on a filter's normalised innovations.

However rows come in blocks, a detector sees the same: what it needs of rows before is kept in the
report, from a start of the observer on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, nearest
from reobserve.core.validation import Count, Positive, checked
from reobserve.detection.detectors import chi_square_window, cusum_of_mean, glr_of_mean
from reobserve.detection.innovation_tests import cusum
from reobserve.detection.normalised_squares import normalised_innovations
from reobserve.estimation.data_report import AlarmReport, DataReport, follow

Array = NDArray[np.float64]

PREDICTING = "kalman, augmented-kalman, extended-kalman, unscented-kalman and svsf"
BLIND = (
    "is blind to what the gate leaves out; take an alarm of a column of outliers in its place, or "
    "state outliers: inflate where the kind has it"
)
_KEYS = {"chi_square_window": "length", "cusum_of_mean": "shift", "glr_of_mean": "lengths"}


def _rate(place: str, value: float) -> None:
    chi_square_window([], 1, 1, value)  # which refuses what is out of its range


@dataclass(frozen=True)
class DetectorRule:
    """An alarm by a detector, with a rate of false alarms as long as the filter's model holds.

    ``chi_square_window`` has a ``length`` [rows], ``glr_of_mean`` the ``lengths`` of its windows,
    and ``cusum_of_mean`` the ``shift`` [standard deviations] that it finds quickest, ``of`` one
    measurement. The rate is per row, see `reobserve.detection.detectors`.
    """

    name: str
    detector: Literal["chi_square_window", "cusum_of_mean", "glr_of_mean"]
    false_alarm_rate: Annotated[float, checked(_rate)]
    length: Count | None = None
    lengths: list[Count] = field(default_factory=list)
    shift: Positive | None = None
    of: str = ""

    def __post_init__(self) -> None:
        wanted = {_KEYS[self.detector], *(["of"] if self.detector == "cusum_of_mean" else [])}
        for name in ("length", "lengths", "shift", "of"):
            given = getattr(self, name) not in (None, "", [])
            if given != (name in wanted):
                problem = "is missing" if not given else "must be left out"
                raise InputError(name, f"{problem} with the detector {self.detector}")


@dataclass
class DetectorAlarm:
    """An alarm where a detector's statistic exceeds its threshold."""

    rule: DetectorRule
    period: float
    place: int  # of the measurement of a cumulative sum
    column: int = -1  # of the results: none

    def raised(
        self, time: Array, numbers: Array, report: DataReport, estimates: Mapping[str, Array]
    ) -> Array:
        """1 where the alarm is raised, 0 where not."""
        entry = report.alarms[self.rule.name]
        statistic = self._statistic(estimates, entry)
        assert entry.threshold is not None
        raised = (statistic > entry.threshold).astype(np.float64)
        if entry.current is not None or raised.any():
            follow(time, statistic, None, raised, entry, self.period)
        return raised

    def _statistic(self, estimates: Mapping[str, Array], entry: AlarmReport) -> Array:
        rule = self.rule
        distances, whitened = normalised_innovations(
            estimates["innovation"], estimates["innovation_covariance"]
        )
        m, rate = whitened.shape[1], rule.false_alarm_rate
        if rule.shift is not None:
            # e_o / sqrt(S_oo): whitened ones of later outputs contain those before
            S = estimates["innovation_covariance"][:, self.place, self.place]
            values, both = estimates["innovation"][:, self.place] / np.sqrt(S), []
            last = entry.memory[0] if entry.memory else [0.0, 0.0]
            for sign, start in zip((1.0, -1.0), last, strict=True):
                both.append(cusum(sign * values - rule.shift / 2.0, start))
            entry.threshold = entry.threshold or cusum_of_mean([], rule.shift, rate).threshold
            entry.memory = [[float(side[-1]) for side in both]]
            return np.maximum(*both)
        if rule.length is not None:
            values, longest = distances[:, None], rule.length
        else:
            values, longest = whitened, max(rule.lengths)
        before = np.array(entry.memory, dtype=np.float64).reshape(-1, values.shape[1])
        rows = np.concatenate([before, values])
        if rule.length is not None:
            result = chi_square_window(rows[:, 0], m, rule.length, rate)
        else:
            result = glr_of_mean(rows, rule.lengths, rate)
        entry.threshold = result.threshold
        known = rows[~np.isnan(rows).any(axis=1)]
        entry.memory = known[max(len(known) - longest, 0) :].tolist()
        return result.statistic[len(before) :]


def detector_alarm(
    rule: DetectorRule, k: int, period: float, measurements: Sequence[str], predicts: bool,
    skips: bool,
) -> DetectorAlarm:  # fmt: skip
    """The alarm of a rule, the k-th of a specification."""
    if not predicts:
        problem = f"is for filters that predict the covariance of their innovations: {PREDICTING}"
        raise InputError(f"alarms.{k}.detector", problem)
    if skips:
        raise InputError(f"alarms.{k}.detector", BLIND)
    if rule.of and rule.of not in measurements:
        problem = f"there is no measurement {rule.of!r}{nearest(rule.of, measurements)}"
        raise InputError(f"alarms.{k}.of", problem)
    place = list(measurements).index(rule.of) if rule.of else 0
    return DetectorAlarm(rule, period, place)
