"""What must tell that a plant has changed from one model to another: banks, and standard tests.

Each makes of a record one number a sample, its statistic, and alarms where that exceeds a
threshold, which records without a fault decide. Of a bank it is the logarithm of the odds of the
faulty model. Beside the banks of the parameter file there are, on the first one's two filters,
each for itself: a bank without mixing, Page's cumulative sum of the logarithms of their likelihood
ratios, and, on the normal model's filter alone, the likelihood ratio for innovations that have
become larger. The second half counts detected faults, false alarms and delays.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.kernel import kernel
from reobserve.observers.imm import IMM
from reobserve.observers.imm_loop import mixing_probabilities, update_probabilities
from reobserve.observers.linear_filter import LinearFilter
from reobserve.papers.imm import keys
from reobserve.papers.imm.innovation_tests import cusum, inflation_glr
from reobserve.papers.imm.setup import run, stacked_inputs, start_alone
from reobserve.papers.imm.study_rows import CUSUM, GLR, UNMIXED, sweep_kind
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.study_table import StudyTable

Array = NDArray[np.float64]
Bank = tuple[IMM, keys.Observer]

LENGTHS = 2 ** np.arange(10)  # samples: how long ago the likelihood ratio takes a change to be

RESAMPLES = 1000  # of the runs, for an interval

FAR = 700.0  # of the logarithm of odds: exp(-FAR) is about the least probability that can be told


@dataclass(frozen=True)
class Detectors:
    """Banks of two models, the normal one first, by name; and the tests on the first one's filters.

    A record's first ``settling`` rows tell the tests nothing: the filters come from other states.
    ``rest`` are `rest_likelihoods` of as many rows as a record has or more, and ``expected`` is the
    mean of `distances` over records without a fault: m, if the model's noise is the plant's.
    """

    banks: Mapping[str, Bank]
    settling: int
    rest: Array
    expected: float

    def statistics(self, measured: Array, held: Array) -> dict[str, Array]:
        """By detector, each shape (k,); -inf from where a bank diverged.

        ``measured``, shape (k, m), are ends of steps and ``held``, (k,), the inputs over them.
        """
        found = {name: log_odds(bank, measured, held) for name, bank in self.banks.items()}
        first = next(iter(self.banks.values()))
        normal, faulty = (likelihoods(first, mode, measured, held) for mode in (0, 1))
        told = np.stack([normal, faulty], axis=1)
        found[UNMIXED] = unmixed_log_odds(np.asarray(first[0].transition), told)
        ratios, far = faulty - normal, distances(self.rest, normal)
        ratios[: self.settling] = far[: self.settling] = np.nan
        found[CUSUM] = cusum(ratios)
        outputs = first[0].measurements
        found[GLR] = inflation_glr(far * (outputs / self.expected), outputs, LENGTHS)
        return found


def log_odds(bank: Bank, measured: Array, held: Array) -> Array:
    """Of the faulty model, shape (k,), between -700 and 700; -inf from where the bank diverged."""
    found = run(*bank, measured, held)["probability"]
    known = np.log(np.maximum(found, math.exp(-FAR)))
    odds = np.full(len(measured), -np.inf)
    odds[: len(known)] = known[:, 1] - known[:, 0]
    return odds


def likelihoods(bank: Bank, mode: int, measured: Array, held: Array) -> Array:
    """Log-likelihoods of a record, shape (k,), by the filter of one mode, which runs alone."""
    one, observer = bank
    alone = cast(LinearFilter, one.filters[mode])
    begin = start_alone(alone, observer, held[0])
    return np.asarray(alone.run(measured, stacked_inputs(held), state=begin)["log_likelihood"])


def rest_likelihoods(bank: Bank, rows: int) -> Array:
    """Those of a record at rest by the normal model's filter: no innovation, and the same S."""
    return likelihoods(bank, 0, np.zeros((rows, bank[0].measurements)), np.zeros(rows))


def distances(rest: Array, told: Array) -> Array:
    """e' S^-1 e, shape (k,): twice what a record's log-likelihoods fall short of those at rest."""
    return np.maximum(2.0 * (rest[: len(told)] - told), 0.0)


@kernel
def unmixed_log_odds(transition: Array, told: Array) -> Array:
    """Of the second of two modes, shape (k,), from equal odds a sample before the first.

    ``told`` are log-likelihoods, shape (k, 2): only the probabilities follow the chain.
    """
    odds = np.empty(len(told))
    weights, predicted = np.empty((2, 2)), np.empty(2)
    log_probabilities = np.full(2, -math.log(2.0))
    for k in range(len(told)):
        mixing_probabilities(transition, log_probabilities, weights, predicted)
        log_probabilities[:] = predicted
        update_probabilities(log_probabilities, told[k])
        odds[k] = log_probabilities[1] - log_probabilities[0]
    return odds


def threshold(greatest: Array, false_alarm_probability: float) -> float:
    """What the greatest statistic of a new record exceeds with this probability at most.

    ``greatest`` are those of n records without a fault, shape (n,). One more is as likely to be the
    first, second, ... of all n + 1, so it exceeds the j-th with a probability of 1 - j / (n + 1).

    Raises
    ------
    InputError
        If there are too few records for the false_alarm_probability.
    """
    place = math.ceil((1.0 - false_alarm_probability) * (len(greatest) + 1) - 1e-9)
    if place > len(greatest):
        needed = math.ceil(1.0 / false_alarm_probability - 1e-9) - 1
        raise InputError(
            "false_alarm_probability",
            f"{false_alarm_probability:g} needs {needed} records without a fault or more, "
            f"there are {len(greatest)}",
        )
    return float(np.sort(greatest)[place - 1])


@dataclass(frozen=True)
class Share:
    """Of so many runs so many, with Wilson's interval of 95 %."""

    count: int
    runs: int

    @property
    def value(self) -> float:
        """The share, nan of no runs."""
        return self.count / self.runs if self.runs else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Its limits; from 0 to 1 of no runs."""
        if not self.runs:
            return 0.0, 1.0
        from scipy.stats import binomtest

        found = binomtest(self.count, self.runs).proportion_ci(0.95, method="wilson")
        return float(found.low), float(found.high)


@dataclass(frozen=True)
class Judged:
    """A detector on one pair of models.

    ``detected`` are those of the runs without an alarm before the fault that have one after it;
    ``alarmed`` those of all runs with a false alarm. ``delay`` [s] is the median over the former
    runs, nan where half of them or more have no alarm.
    """

    gap: float
    detected: Share
    alarmed: Share
    delay: float


def judge(gap: float, alarm_times: Array) -> Judged:
    """From the times of first alarms, counted from the fault: up to zero false, nan for none."""
    false = alarm_times <= 0
    fair = alarm_times[~false]
    delay = float(np.median(np.where(np.isnan(fair), np.inf, fair))) if len(fair) else np.inf
    return Judged(
        gap,
        Share(int(np.count_nonzero(fair > 0)), len(fair)),
        Share(int(np.count_nonzero(false)), len(alarm_times)),
        delay if np.isfinite(delay) else float("nan"),
    )


def curve(study: StudyTable, name: str, sweep: str) -> list[Judged]:
    """A detector on all pairs of a sweep, from the closest on."""
    table = study.where(sweep=sweep)
    gaps = table.where(observer="models")
    found = [
        judge(gaps.value(level=share), runs["value"])
        for (share,), runs in table.where(observer=name, quantity="alarm_time").groups("level")
    ]
    return sorted(found, key=lambda one: one.gap)


def measure(study: StudyTable, enough: float) -> Iterator[Metric]:
    """By detector, plant, noise and share; and the gaps from which on faults are told."""
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
        yield from _least_gaps("least_gap", name, gaps, [one.detected for one in found], enough, at)
        false = [one.alarmed for one in found]
        all_runs = Share(sum(one.count for one in false), sum(one.runs for one in false))
        yield Metric.at(name, ("alarmed_share", all_runs.value, "1"), **at)
        for end, limit in zip(("low", "high"), all_runs.interval, strict=True):
            yield Metric.at(name, (f"alarmed_share_{end}", limit, "1"), **at)
        yield from _diagnoses(study.where(observer=name, sweep=sweep), name, gaps, enough, at)


def _diagnoses(
    rows: StudyTable, name: str, gaps: list[float], enough: float, at: dict[str, float | str]
) -> Iterator[Metric]:
    """Of banks: the gap from which on the faulty model is the more probable one after the fault."""
    right: list[tuple[float, Share]] = []
    for (share,), runs in rows.where(quantity="probability_after").groups("level"):
        correct = int(np.count_nonzero(runs["value"] > 0.5))
        right.append((share, Share(correct, len(runs["value"]))))
    if right:
        shares = [one for _, one in sorted(right, key=lambda pair: pair[0])]
        yield from _least_gaps("least_gap_of_diagnosis", name, gaps, shares, enough, at)


def _least_gaps(
    metric: str,
    name: str,
    gaps: list[float],
    shares: list[Share],
    enough: float,
    at: dict[str, float | str],
) -> Iterator[Metric]:
    """The gap that is enough, and its interval of 95 %; nan if there is none."""
    least = enough_gap(gaps, [one.value for one in shares], enough)
    yield Metric.at(name, (metric, least, "1"), **at)
    for end, limit in zip(("low", "high"), gap_interval(gaps, shares, enough), strict=True):
        yield Metric.at(name, (f"{metric}_{end}", limit, "1"), **at)


def gap_interval(gaps: list[float], shares: list[Share], wanted: float) -> tuple[float, float]:
    """Bootstrap interval of 95 % of `enough_gap`, over the runs; nan for an end that is beyond."""
    runs = np.array([one.runs for one in shares])
    stream = np.random.default_rng(0)
    counts = stream.binomial(runs, [one.value for one in shares], (RESAMPLES, len(shares)))
    found = np.array([enough_gap(gaps, list(row), wanted) for row in counts / runs])
    found[np.isnan(found)] = np.inf
    ends = np.quantile(found, (0.025, 0.975), method="inverted_cdf")
    ends[np.isinf(ends)] = np.nan
    return float(ends[0]), float(ends[1])


def enough_gap(gaps: list[float], right: list[float], wanted: float) -> float:
    """The gap from which on the share is ``wanted`` or more.

    Between the last gap of the study with a smaller share and the next it is taken as linear over
    the logarithm; nan if the widest gap is not enough, and the least one if all are.
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
