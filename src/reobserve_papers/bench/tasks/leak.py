"""Leak of an electrohydrostatic actuator, to be detected early at few false alarms.

A random binary voltage moves the actuator of Gadsden et al. 2011, whose velocity is measured; an
unmodelled voltage is added to it. At a random time its model goes a random share of the way from
the normal to the leaking one. Each method makes of a record one number a sample, its statistic, and
alarms where that exceeds a threshold; its estimate is 1 there. The threshold is not tuned: a share
``rate`` of healthy records may alarm (`reobserve.detection.false_alarms`), in the condition of the
record or, if it is ``kept``, in the nominal one. If the model is wrong these are records of the
same plant, of which each record has another one.

The error is the delay over one second. A miss, no alarm within a second, and an alarm before the
leak have 1. Errors are averaged by their logarithms: of 40 records, one miss in place of a delay of
20 ms makes the mean 10 % larger, whatever it is; it adds 25 ms to the arithmetic mean. The
share of false alarms is that of three other healthy records for each record with a leak.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.detection.detectors import chi_square_window
from reobserve.detection.false_alarms import false_alarm_threshold
from reobserve.detection.innovation_tests import cusum, inflation_glr
from reobserve.detection.restarted_cusum import restarted_cusum
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.systems.linear import LinearModel
from reobserve.tuning.record_score import Score
from reobserve.tuning.search import Settings
from reobserve.tuning.task import Array, Condition, TaskRecord, estimates_of
from reobserve_papers.bench.leaks import (
    DISTURBED,
    FAULTY,
    HOLD,
    LeakRecord,
    Level,
    Plant,
    healthy_records,
    record_of,
    without_threshold,
)
from reobserve_papers.papers.imm.setup import STATE_FREQUENCY
from reobserve_papers.plants.hydraulic_actuator import ActuatorModel
from reobserve_papers.signals.random_streams import random_stream

Statistic = Callable[[TaskRecord], Array]
NOMINAL: Level = (1.0, 0.0, 1)
REST = 1e-6  # variance of the first state, in which the plant is at rest
CAP = 1.0  # [s], the longest delay
LENGTHS = 2 ** np.arange(10)  # samples since a change, for the likelihood ratio
FAR = 700.0  # limit of log odds: exp(-FAR) is about the smallest probability
REDRAWN = 40  # thresholds from resampled healthy records, for the intervals
COLUMNS = ("mean delay", "false alarms")  # what lag and quantile are in the table
NOTE = (
    "Cells: geometric mean of the delay [s], where a miss (no alarm within a second) and an alarm "
    "before the leak count one second. Mean delay: arithmetic, a miss counts one second, records "
    "with an alarm before the leak are left out. False alarms: share of healthy records."
)


def simulate(plant: Plant, condition: Condition, seed: int, period: float) -> LeakRecord:
    """A record, for which a wrong model has other coefficients, the same in all modes."""
    level = condition.noise, condition.model, condition.period
    for held in (HOLD, DISTURBED):
        rows = held / (period * condition.period)
        if abs(rows - round(rows)) > 1e-6:
            problem = f"must divide {held:g} s, for which a voltage is held"
            raise InputError("period", f"{period * condition.period:g} s {problem}")
    return record_of(without_threshold(plant), level, seed, period, FAULTY)


def score(
    run: Callable[[Any], Array], record: LeakRecord, since: float, *, details: bool = True
) -> Score:
    """The delay, 1 for an alarm before the leak, where ``quantile`` is the share of false alarms.

    That is of the healthy records. ``lag`` is the delay in seconds, nan for an alarm before the
    leak. The row at which it begins does not show it yet. ``redrawn`` are delays for thresholds
    from resampled healthy records, if all records have one threshold.
    """
    rows = record.time >= since - 1e-9
    onset = float(record.time[np.argmax(record.truth[:, 0] > 0)])

    times = np.append(record.time[rows], np.inf)  # of a first alarm, the last one for none

    def errors(delays: NDArray[Any]) -> Array:
        return np.where(delays < 1e-9, 1.0, np.minimum(delays, CAP) / CAP)

    alarms = run(record)[rows, 0]
    late = float(times[np.argmax(alarms) if alarms.any() else -1]) - onset
    (error,) = errors(np.array([late])).tolist()
    if not details:
        return Score(error)
    false = float(np.mean([run(healthy)[rows].any() for healthy in record.healthy()]))
    redrawn: tuple[float, ...] = ()
    if isinstance(run, Detector):
        largest = np.maximum.accumulate(run.statistic(record)[rows])  # so far
        first = np.searchsorted(largest, run.redrawn(record), side="right")
        redrawn = tuple(errors(times[first] - onset).tolist())
    return Score(
        error, math.nan if late < 1e-9 else min(late, CAP), false,
        missed=float(late >= CAP), redrawn=redrawn,
    )  # fmt: skip


# Of a detector: its function, the plant that it knows, settings, period and noise.
_Known = tuple[Callable[..., Statistic], Plant, tuple[tuple[str, float], ...], float, float]


@lru_cache(maxsize=512)
def _made(
    make: Callable[..., Statistic],
    plant: Plant,
    settings: tuple[tuple[str, float], ...],
    period: float,
    noise: float,
) -> Statistic:
    return make(plant, dict(settings), period, noise)


@lru_cache(maxsize=512)
def _statistic(known: _Known) -> Statistic:
    return lru_cache(maxsize=1024)(_made(*known))


@lru_cache(maxsize=512)
def _largest(known: _Known, level: Level) -> tuple[float, ...]:
    """The largest statistics of healthy records in a condition, of the plant that methods know."""
    _, plant, _, period, _ = known
    statistic = _made(*known)
    return tuple(
        float(statistic(data).max()) for data in healthy_records(plant, level, period / level[2])
    )


@lru_cache(maxsize=4096)
def _largest_own(known: _Known, record: LeakRecord) -> tuple[float, ...]:
    """The same of the plant of a record."""
    statistic = _made(*known)
    return tuple(float(statistic(healthy).max()) for healthy in record.before())


@lru_cache(maxsize=512)
def _redrawn(largest: tuple[float, ...], rate: float) -> tuple[float, ...]:
    """Thresholds of resampled healthy records, the same ones for all detectors."""
    stream, count = random_stream(1, "bench", "leak", "thresholds"), len(largest)
    samples = np.array(largest)[stream.integers(0, count, (REDRAWN, count))]
    return tuple(false_alarm_threshold(sample, rate) for sample in samples)


def forget() -> None:
    """Clear the statistics of records, which are computed once for all thresholds."""
    _made.cache_clear()
    _statistic.cache_clear()


@dataclass(frozen=True)
class Detector:
    """Alarms where the statistic exceeds a threshold from healthy records.

    These are of the plant of the record, so that a plant of which the model is wrong has a
    threshold of its own; those of the plant that methods know are the same for all records.
    """

    plant: Plant
    known: _Known

    def __call__(self, record: Any) -> Array:
        """One for an alarm, else zero, shape (k, 1)."""
        threshold = false_alarm_threshold(self._largest(record), self.plant.rate)
        return (self.statistic(record) > threshold).astype(np.float64)[:, None]

    def statistic(self, record: LeakRecord) -> Array:
        """The statistic of a record."""
        return _statistic(self.known)(record)

    def redrawn(self, record: LeakRecord) -> tuple[float, ...]:
        """Thresholds from healthy records that are drawn again, none if each record has its own."""
        if self._is_own(record):
            return ()
        return _redrawn(self._largest(record), self.plant.rate)

    def _is_own(self, record: LeakRecord) -> bool:
        return self.plant.threshold == "renewed" and record.level[1] != 0

    def _largest(self, record: LeakRecord) -> tuple[float, ...]:
        if self._is_own(record):
            return _largest_own(self.known, record)
        if self.plant.threshold == "renewed":
            return _largest(self.known, record.level)
        make, plant, settings, period, _ = self.known
        return _largest((make, plant, settings, period / record.level[2], plant.noise), NOMINAL)


def detector(
    make: Callable[..., Statistic], plant: Plant, s: Settings, period: float, noise: float
) -> Detector:
    """A detector that knows neither the fault nor, before healthy records, the threshold."""
    about = replace(without_threshold(plant), fault="leakage", share=(0.0, 1.0))
    return Detector(plant, (make, about, tuple(s.items()), period, noise))


def _model(plant: Plant, mode: str, s: Settings, period: float, noise: float) -> LinearModel:
    """The model that lies ``share`` of the way to a mode, with an unknown voltage that drives it.

    ``process`` is the root of its density [V sqrt(s)].
    """
    normal, other = (ActuatorModel(*getattr(plant, name)) for name in ("normal", mode))
    blended = normal.blended(other, s.get("share", 1.0))
    sampled = blended.sampled("velocity", period, STATE_FREQUENCY)
    Q = s["process"] ** 2 / period * sampled.B @ sampled.B.T
    return LinearModel(
        sampled.A, sampled.B, sampled.C, None, Q=Q, R=noise**2, sampling_period=period
    )


def _distances(plant: Plant, s: Settings, period: float, noise: float) -> Statistic:
    """e^2 / S of the normal model's filter."""
    observer = KalmanFilter(_model(plant, "normal", s, period, noise))
    start = observer.init(np.zeros(4), REST)

    def run(record: TaskRecord) -> Array:
        rows = observer.run(record.measurements, record.inputs, start=start)
        return np.asarray(rows["innovation"][:, 0] ** 2 / rows["innovation_covariance"][:, 0, 0])

    return run


def glr(plant: Plant, s: Settings, period: float, noise: float) -> Statistic:
    """Likelihood ratio for innovations that have become larger."""
    distances = _distances(plant, s, period, noise)
    return lambda record: inflation_glr(distances(record), 1, LENGTHS)


def power(plant: Plant, s: Settings, period: float, noise: float) -> Statistic:
    """The sum of e^2 / S over a window [s], which is chi-squared."""
    distances, size = _distances(plant, s, period, noise), max(1, round(s["window"] / period))

    def run(record: TaskRecord) -> Array:
        window = chi_square_window(distances(record), 1, size, 1e-3)
        return np.nan_to_num(window.statistic)

    return run


def bank(kind: str, plant: Plant, s: Settings, period: float, noise: float) -> Statistic:
    """Log odds of the modes that are not normal, each left at the rate ``leave`` [1/s]."""
    models = [_model(plant, mode, s, period, noise) for mode in ("normal", "friction", "leakage")]
    filters = [
        KalmanFilter(model) if kind == "kalman"
        else SmoothVariableStructureFilter(
            model, boundary_layer=s["layer"], convergence_rate=s["memory"]
        )
        for model in models
    ]  # fmt: skip
    stay = math.exp(-s["leave"] * period)
    observer = IMM(filters, (1.5 * stay - 0.5) * np.eye(3) + (1.0 - stay) / 2)
    start = observer.init(np.zeros(4), REST, probabilities=[1.0, 0.0, 0.0])

    def run(record: TaskRecord) -> Array:
        y, u = record.measurements, record.inputs
        modes = np.maximum(estimates_of(observer, "probability", y, u, start=start), math.exp(-FAR))
        return np.asarray(np.log(modes[:, 1] + modes[:, 2]) - np.log(modes[:, 0]))

    return run


def augmented(plant: Plant, s: Settings, period: float, noise: float) -> Statistic:
    """Mean over ``lag`` [s] of the unknown voltage that is lost: minus its estimate times input."""
    from scipy.signal import lfilter

    model = _model(plant, "normal", s, period, noise)
    observer = AugmentedKalmanFilter(model, fault_matrix=model.B, random_walk=s["walk"] ** 2)
    start = observer.init(np.zeros(4), REST, unknown_input_covariance=0.0)
    decay = math.exp(-period / s["lag"])

    def run(record: TaskRecord) -> Array:
        y, u = record.measurements, record.inputs
        lost = -estimates_of(observer, "unknown_input", y, u, start=start)[1:, 0] * u[:-1, 0]
        return np.asarray(lfilter([1.0 - decay], [1.0, -decay], np.r_[0.0, lost]))

    return run


def sum_of_ratios(
    restarts: bool, plant: Plant, s: Settings, period: float, noise: float
) -> Statistic:
    """Page's cumulative sum of the filters of the normal and the leaking model."""
    normal, leaky = (
        KalmanFilter(_model(plant, mode, s, period, noise)) for mode in ("normal", "leakage")
    )
    start = normal.init(np.zeros(4), REST)

    def run(record: TaskRecord) -> Array:
        y, u = record.measurements, record.inputs
        if restarts:
            return restarted_cusum(normal, leaky, y, u, start)
        logs = [estimates_of(each, "log_likelihood", y, u, start=start) for each in (normal, leaky)]
        return cusum(logs[1] - logs[0])

    return run


METHODS: dict[str, Callable[..., Detector]] = {
    "glr": partial(detector, glr),
    "power": partial(detector, power),
    "imm_kalman": partial(detector, partial(bank, "kalman")),
    "imm_svsf": partial(detector, partial(bank, "svsf")),
    "augmented": partial(detector, augmented),
    "cusum": partial(detector, partial(sum_of_ratios, True)),
    "cusum_alone": partial(detector, partial(sum_of_ratios, False)),
}
