"""Leak of an electrohydrostatic actuator, to be detected early at few false alarms.

A random binary voltage moves the actuator of Gadsden et al. 2011, whose velocity is measured; an
unmodelled voltage is added to it. At a random time its model goes a random share of the way from
the normal to the leaking one. Each method makes of a record one number a sample, its statistic, and
alarms where that exceeds a threshold; its estimate is 1 there. The threshold is not tuned: a share
``rate`` of healthy records may alarm (`reobserve.detection.false_alarms`), in the condition of the
record or, if it is ``kept``, in the nominal one.

The error is the delay over one second. A miss, and an alarm before the leak, have 1. The share of
false alarms is that of three other healthy records for each record with a leak.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Any, Literal

import numpy as np

from reobserve.core.random_streams import held_normal, random_stream
from reobserve.core.validation import Count, NotNegative, Positive, Share
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
from reobserve.tuning.task import Array, Condition, Runner, TaskRecord, estimates_of
from reobserve_papers.papers.imm.setup import STATE_FREQUENCY
from reobserve_papers.plants.hydraulic_actuator import ActuatorModel
from reobserve_papers.plants.hydraulic_actuator import simulate as move

Four = tuple[float, float, float, float]
Level = tuple[float, float, int]  # of a condition: noise, model and period
Statistic = Callable[[TaskRecord], Array]
NOMINAL: Level = (1.0, 0.0, 1)
FAULTY, HEALTHY = "signals", ("healthy", "healthy_2", "healthy_3")  # streams of random numbers
HOLD, DISTURBED = 0.012, 0.02  # [s], of the input and of the unmodelled voltage
REST = 1e-6  # variance of the first state, in which the plant is at rest
CAP = 1.0  # [s], the longest delay
LENGTHS = 2 ** np.arange(10)  # samples since a change, for the likelihood ratio
FAR = 700.0  # limit of log odds: exp(-FAR) is about the smallest probability
COLUMNS = ("delay", "false alarms")  # what lag and quantile are in the table


@dataclass(frozen=True)
class Plant:
    """The models of the actuator, its signals, its fault, and how thresholds are set."""

    normal: tuple[Four, Four]  # numerator and denominator, s^3 to 1
    friction: tuple[Four, Four]
    leakage: tuple[Four, Four]
    noise: Positive  # standard deviation of the velocity [y]
    input: Positive  # amplitude [V]
    disturbance: NotNegative  # rms of the unmodelled voltage [V]
    horizon: Positive  # [s]
    onset: tuple[float, float]  # [s]
    fault: Literal["friction", "leakage"]
    share: tuple[float, float]  # of the way to the faulty model
    healthy: Count  # records that a threshold comes from
    rate: Share  # of healthy records that may alarm
    threshold: Literal["renewed", "kept"]


@dataclass(frozen=True, eq=False)
class LeakRecord(TaskRecord):
    """A record with its condition, and healthy ones of the same plant and input."""

    level: Level
    healthy: Callable[[], list[LeakRecord]]


def simulate(plant: Plant, condition: Condition, seed: int, period: float) -> LeakRecord:
    """A record, for which a wrong model has other coefficients, the same in all modes."""
    level = condition.noise, condition.model, condition.period
    return _record(_without_threshold(plant), level, seed, period, FAULTY)


def _without_threshold(plant: Plant) -> Plant:
    """One for all thresholds: records and statistics do not depend on them."""
    return replace(plant, rate=0.5, threshold="kept")


@lru_cache(maxsize=1024)
def _record(plant: Plant, level: Level, seed: int, period: float, name: str) -> LeakRecord:
    noise, wrong, every = level
    steps, stream = round(plant.horizon / period), random_stream(seed, "bench", "leak", name)
    start, share, models, bits = _drawn(plant, wrong, seed, steps)
    onset = 2 * round(start / (2 * period))  # on a row at twice the period, too
    control = plant.input * bits[np.arange(steps) // round(HOLD / period)]
    push = plant.disturbance * held_normal(stream, steps, round(DISTURBED / period))[0]
    mode = ((np.arange(steps) >= onset) & (name == FAULTY)).astype(np.int64)
    velocity = move(models, mode, control + push, period)[:, 1:2]
    measured = velocity + noise * plant.noise * stream.standard_normal(velocity.shape)
    last = np.minimum(np.arange(steps + 1), steps - 1)
    columns = control[last, None], measured, share * mode[last, None]
    inputs, measurements, truth = (np.asarray(one[::every], np.float64) for one in columns)
    time, same = period * np.arange(0.0, steps + 1.0, every), (plant, level, seed, period)
    return LeakRecord(
        time, inputs, measurements, truth, level, lambda: [_record(*same, one) for one in HEALTHY]
    )


@lru_cache(maxsize=8)
def _drawn(
    plant: Plant, wrong: float, seed: int, steps: int
) -> tuple[float, float, list[ActuatorModel], Array]:
    """Onset of the fault [s], its share, the normal and the faulty model, signs of the input."""
    draw = random_stream(seed, "bench", "leak", "plant")
    onset, share = draw.uniform(*plant.onset), draw.uniform(*plant.share)
    factors = 1.0 + wrong * np.sign(draw.uniform(-1.0, 1.0, (2, 4)))
    normal, other = (
        ActuatorModel(*(np.array(one) * factors))
        for one in (plant.normal, getattr(plant, plant.fault))
    )
    bits = np.asarray(2.0 * draw.integers(0, 2, steps) - 1.0, np.float64)
    return onset, share, [normal, normal.blended(other, share)], bits


def score(
    run: Callable[[Any], Array], record: LeakRecord, since: float, *, details: bool = True
) -> Score:
    """The delay, 1 for an alarm before the leak, where ``quantile`` is the share of false alarms.

    That is of the healthy records. ``lag`` is the delay in seconds, nan for an alarm before the
    leak. The row at which it begins does not show it yet.
    """
    rows = record.time >= since - 1e-9
    onset = record.time[np.argmax(record.truth[:, 0] > 0)]
    times = record.time[rows & run(record)[:, 0].astype(bool)]
    delay = min(float(times[0] - onset), CAP) if len(times) else CAP
    early = delay < 1e-9
    healthy = record.healthy() if details else []
    false = float(np.mean([run(one)[rows].any() for one in healthy])) if healthy else math.nan
    return Score(1.0 if early else delay / CAP, math.nan if early else delay, false)


@lru_cache(maxsize=8)
def _healthy(plant: Plant, level: Level, period: float) -> tuple[LeakRecord, ...]:
    seeds = range(5001, 5001 + plant.healthy)
    return tuple(_record(plant, level, seed, period, HEALTHY[0]) for seed in seeds)


# Of a detector: its function, the plant that it knows, settings, period and noise.
_Known = tuple[Callable[..., Statistic], Plant, tuple[tuple[str, float], ...], float, float]


@lru_cache(maxsize=512)
def _statistic(
    make: Callable[..., Statistic],
    plant: Plant,
    settings: tuple[tuple[str, float], ...],
    period: float,
    noise: float,
) -> Statistic:
    return lru_cache(maxsize=1024)(make(plant, dict(settings), period, noise))


@lru_cache(maxsize=512)
def _largest(known: _Known, level: Level) -> tuple[float, ...]:
    """The largest statistics of healthy records in a condition."""
    _, plant, _, period, _ = known
    records, statistic = _healthy(plant, level, period / level[2]), _statistic(*known)
    return tuple(float(statistic(one).max()) for one in records)


def forget() -> None:
    """Clear the statistics of records, which are computed once for all thresholds."""
    _statistic.cache_clear()


def detector(
    make: Callable[..., Statistic], plant: Plant, s: Settings, period: float, noise: float
) -> Callable[[Any], Array]:
    """Alarms where the statistic exceeds the threshold."""
    # What it knows, and healthy records, depend neither on the fault nor on the threshold.
    about = (
        make,
        replace(_without_threshold(plant), fault="leakage", share=(0.0, 1.0)),
        tuple(s.items()),
    )

    def run(record: Any) -> Array:
        known, level = (*about, period, noise), record.level
        before = (*about, period / level[2], plant.noise), NOMINAL
        largest = _largest(*before) if plant.threshold == "kept" else _largest(known, level)
        alarms = _statistic(*known)(record) > false_alarm_threshold(largest, plant.rate)
        return alarms.astype(np.float64)[:, None]

    return run


def _model(plant: Plant, mode: str, s: Settings, period: float, noise: float) -> LinearModel:
    """The model that lies ``share`` of the way to a mode, with an unknown voltage that drives it.

    ``process`` is the root of its density [V sqrt(s)].
    """
    normal, other = (ActuatorModel(*getattr(plant, one)) for one in ("normal", mode))
    blended = normal.blended(other, s.get("share", 1.0))
    one = blended.sampled("velocity", period, STATE_FREQUENCY)
    Q = s["process"] ** 2 / period * one.B @ one.B.T
    return LinearModel(one.A, one.B, one.C, None, Q, noise**2, sampling_period=period)


def _distances(plant: Plant, s: Settings, period: float, noise: float) -> Statistic:
    """e^2 / S of the normal model's filter."""
    observer = KalmanFilter(_model(plant, "normal", s, period, noise))
    start = observer.init(np.zeros(4), REST)

    def run(record: TaskRecord) -> Array:
        found = observer.run(record.measurements, record.inputs, state=start)
        return np.asarray(found["innovation"][:, 0] ** 2 / found["innovation_covariance"][:, 0, 0])

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
    models = [_model(plant, one, s, period, noise) for one in ("normal", "friction", "leakage")]
    filters = [
        KalmanFilter(one) if kind == "kalman"
        else SmoothVariableStructureFilter(one, s["layer"], s["memory"])
        for one in models
    ]  # fmt: skip
    stay = math.exp(-s["leave"] * period)
    observer = IMM(filters, (1.5 * stay - 0.5) * np.eye(3) + (1.0 - stay) / 2)
    start = observer.init(np.zeros(4), REST, [1.0, 0.0, 0.0])

    def run(record: TaskRecord) -> Array:
        y, u = record.measurements, record.inputs
        modes = np.maximum(estimates_of(observer, "probability", y, u, state=start), math.exp(-FAR))
        return np.asarray(np.log(modes[:, 1] + modes[:, 2]) - np.log(modes[:, 0]))

    return run


def augmented(plant: Plant, s: Settings, period: float, noise: float) -> Statistic:
    """Mean over ``lag`` [s] of the unknown voltage that is lost: minus its estimate times input."""
    from scipy.signal import lfilter

    model = _model(plant, "normal", s, period, noise)
    observer = AugmentedKalmanFilter(model, model.B, s["walk"] ** 2 * period)
    start = observer.init(np.zeros(4), REST, unknown_input_covariance=0.0)
    decay = math.exp(-period / s["lag"])

    def run(record: TaskRecord) -> Array:
        y, u = record.measurements, record.inputs
        lost = -estimates_of(observer, "unknown_input", y, u, state=start)[1:, 0] * u[:-1, 0]
        return np.asarray(lfilter([1.0 - decay], [1.0, -decay], np.r_[0.0, lost]))

    return run


def sum_of_ratios(
    restarts: bool, plant: Plant, s: Settings, period: float, noise: float
) -> Statistic:
    """Page's cumulative sum of the filters of the normal and the leaking model."""
    one, other = (
        KalmanFilter(_model(plant, mode, s, period, noise)) for mode in ("normal", "leakage")
    )
    start = one.init(np.zeros(4), REST)

    def run(record: TaskRecord) -> Array:
        y, u = record.measurements, record.inputs
        if restarts:
            return restarted_cusum(one, other, y, u, start)
        logs = [estimates_of(each, "log_likelihood", y, u, state=start) for each in (one, other)]
        return cusum(logs[1] - logs[0])

    return run


METHODS: dict[str, Callable[..., Runner]] = {
    "glr": partial(detector, glr),
    "power": partial(detector, power),
    "imm_kalman": partial(detector, partial(bank, "kalman")),
    "imm_svsf": partial(detector, partial(bank, "svsf")),
    "augmented": partial(detector, augmented),
    "cusum": partial(detector, partial(sum_of_ratios, True)),
    "cusum_alone": partial(detector, partial(sum_of_ratios, False)),
}
