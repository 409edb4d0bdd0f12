"""Detected faults, delays and false alarms over runs, and the smallest distinguishable gap."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reobserve.papers.imm.study_rows import sweep_kind
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.study_table import StudyTable

Array = NDArray[np.float64]

RESAMPLES = 1000  # of the runs, for an interval


@dataclass(frozen=True)
class Share:
    """A share of runs, with Wilson's interval of 95 %."""

    count: int
    runs: int

    @property
    def value(self) -> float:
        """The share; nan without runs."""
        return self.count / self.runs if self.runs else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Limits of the interval; 0 and 1 without runs."""
        if not self.runs:
            return 0.0, 1.0
        from scipy.stats import binomtest

        found = binomtest(self.count, self.runs).proportion_ci(0.95, method="wilson")
        return float(found.low), float(found.high)


@dataclass(frozen=True)
class DetectionRates:
    """Detections, false alarms and delay of a detector on one pair of models.

    ``detected`` is the share of the runs without a false alarm that have an alarm after the fault,
    ``alarmed`` the share of all runs that have a false alarm. ``delay`` [s] is the median over the
    runs without a false alarm, nan if half of them or more have no alarm.
    """

    gap: float
    detected: Share
    alarmed: Share
    delay: float


def detection_rates(gap: float, alarm_times: Array) -> DetectionRates:
    """Rates from first alarms [s] after the fault: 0 or less is a false alarm, nan is none."""
    false = alarm_times <= 0
    fair = alarm_times[~false]
    delay = float(np.median(np.where(np.isnan(fair), np.inf, fair))) if len(fair) else np.inf
    return DetectionRates(
        gap,
        Share(int(np.count_nonzero(fair > 0)), len(fair)),
        Share(int(np.count_nonzero(false)), len(alarm_times)),
        delay if np.isfinite(delay) else float("nan"),
    )


def curve(study: StudyTable, name: str, sweep: str) -> list[DetectionRates]:
    """The rates of a detector on all pairs of a sweep, from the smallest gap to the largest."""
    table = study.where(sweep=sweep)
    gaps = table.where(observer="models")
    found = [
        detection_rates(gaps.value(level=share), runs["value"])
        for (share,), runs in table.where(observer=name, quantity="alarm_time").groups("level")
    ]
    return sorted(found, key=lambda one: one.gap)


def measure(study: StudyTable, enough: float) -> Iterator[Metric]:
    """Metrics by detector, plant, noise and share, and the minimum gaps for detection."""
    for (share,), rows in study.where(observer="models").groups("level"):
        yield Metric.at("models", ("nu_gap", float(rows["value"][0]), "1"), share=share)
    alarms = study.where(quantity="alarm_time")
    for (name, sweep), _ in alarms.groups("observer", "sweep"):
        plant, noise = sweep_kind(sweep)
        at: dict[str, float | str] = {"plant": plant, "noise": noise}
        found = curve(study, name, sweep)
        shares = sorted(alarms.where(observer=name, sweep=sweep).levels("level"))
        for share, one in zip(shares, found, strict=True):
            yield Metric.at(name, ("detected_share", one.detected.value, "1"), **at, share=share)
            yield Metric.at(name, ("alarmed_share", one.alarmed.value, "1"), **at, share=share)
            yield Metric.at(name, ("median_delay", one.delay, "s"), **at, share=share)
        gaps = [one.gap for one in found]
        yield from _minimum_gaps(
            "minimum_gap", name, gaps, [one.detected for one in found], enough, at
        )
        false = [one.alarmed for one in found]
        all_runs = Share(sum(one.count for one in false), sum(one.runs for one in false))
        yield Metric.at(name, ("alarmed_share", all_runs.value, "1"), **at)
        for end, limit in zip(("low", "high"), all_runs.interval, strict=True):
            yield Metric.at(name, (f"alarmed_share_{end}", limit, "1"), **at)
        yield from _diagnoses(study.where(observer=name, sweep=sweep), name, gaps, enough, at)


def _diagnoses(
    rows: StudyTable, name: str, gaps: list[float], enough: float, at: dict[str, float | str]
) -> Iterator[Metric]:
    """The minimum gap at which a bank finds the faulty model more probable after the fault."""
    right: list[tuple[float, Share]] = []
    for (share,), runs in rows.where(quantity="probability_after").groups("level"):
        correct = int(np.count_nonzero(runs["value"] > 0.5))
        right.append((share, Share(correct, len(runs["value"]))))
    if right:
        shares = [one for _, one in sorted(right, key=lambda pair: pair[0])]
        yield from _minimum_gaps("minimum_diagnosis_gap", name, gaps, shares, enough, at)


def _minimum_gaps(
    metric: str,
    name: str,
    gaps: list[float],
    shares: list[Share],
    enough: float,
    at: dict[str, float | str],
) -> Iterator[Metric]:
    """The minimum sufficient gap and its interval of 95 %; nan if there is none."""
    gap = enough_gap(gaps, [one.value for one in shares], enough)
    yield Metric.at(name, (metric, gap, "1"), **at)
    for end, limit in zip(("low", "high"), gap_interval(gaps, shares, enough), strict=True):
        yield Metric.at(name, (f"{metric}_{end}", limit, "1"), **at)


def gap_interval(gaps: list[float], shares: list[Share], wanted: float) -> tuple[float, float]:
    """Bootstrap interval of 95 % of `enough_gap`; an end beyond the widest gap is nan."""
    runs = np.array([one.runs for one in shares])
    stream = np.random.default_rng(0)
    counts = stream.binomial(runs, [one.value for one in shares], (RESAMPLES, len(shares)))
    found = np.array([enough_gap(gaps, list(row), wanted) for row in counts / runs])
    found[np.isnan(found)] = np.inf
    ends = np.quantile(found, (0.025, 0.975), method="inverted_cdf")
    ends[np.isinf(ends)] = np.nan
    return float(ends[0]), float(ends[1])


def enough_gap(gaps: list[float], right: list[float], wanted: float) -> float:
    """The minimum gap above which the share is ``wanted`` or more.

    It is interpolated between the last gap with a smaller share and the next, linearly over the
    logarithm of the gap. It is nan if the widest gap is not enough, and the smallest if all are.
    """
    good = len(gaps)
    while good and right[good - 1] >= wanted:
        good -= 1
    if good == len(gaps):
        return float("nan")
    if good == 0:
        return gaps[0]
    share = (wanted - right[good - 1]) / (right[good] - right[good - 1])
    return float(gaps[good - 1] * (gaps[good] / gaps[good - 1]) ** share)
