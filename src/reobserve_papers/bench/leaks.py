"""Records of a leaking actuator, and healthy ones of the same plant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from reobserve.core.validation import Count, NotNegative, Positive, Share
from reobserve.tuning.task import Array, TaskRecord
from reobserve_papers.plants.hydraulic_actuator import ActuatorModel
from reobserve_papers.plants.hydraulic_actuator import simulate as move
from reobserve_papers.signals.random_streams import held_normal, random_stream

Four = tuple[float, float, float, float]
Level = tuple[float, float, int]  # of a condition: noise, model and period
FAULTY, HEALTHY = "signals", ("healthy", "healthy_2", "healthy_3")  # streams of random numbers
HOLD, DISTURBED = 0.012, 0.02  # [s], of the input and of the unmodelled voltage


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
    healthy_own: Count  # the same if the model is wrong, for each plant
    rate: Share  # of healthy records that may alarm
    threshold: Literal["renewed", "kept"]


@dataclass(frozen=True, eq=False)
class LeakRecord(TaskRecord):
    """A record with its condition, and healthy ones of the same plant.

    ``healthy`` have the same input, and those in ``before`` other inputs, to set a threshold by.
    """

    level: Level
    healthy: Callable[[], list[LeakRecord]]
    before: Callable[[], list[LeakRecord]]


def without_threshold(plant: Plant) -> Plant:
    """One for all thresholds: records and statistics do not depend on them."""
    return replace(plant, rate=0.5, threshold="kept")


@lru_cache(maxsize=2048)
def record_of(
    plant: Plant, level: Level, seed: int, period: float, name: str, of: int = 0
) -> LeakRecord:
    """The record of a seed, of the plant of this seed or of another one."""
    noise, wrong, every = level
    steps, stream = round(plant.horizon / period), random_stream(seed, "bench", "leak", name)
    start, share, _, bits = drawn(plant, seed, steps)
    models = [actuator(plant, "normal", wrong, of or seed)]
    if name == FAULTY:
        models.append(models[0].blended(actuator(plant, plant.fault, wrong, seed), share))
    onset = 2 * round(start / (2 * period))  # on a row at twice the period, too
    control = plant.input * bits[np.arange(steps) // round(HOLD / period)]
    push = plant.disturbance * held_normal(stream, steps, round(DISTURBED / period))[0]
    mode = ((np.arange(steps) >= onset) & (name == FAULTY)).astype(np.int64)
    velocity = move(models, mode, control + push, period)[:, 1:2]
    measured = velocity + noise * plant.noise * stream.standard_normal(velocity.shape)
    last = np.minimum(np.arange(steps + 1), steps - 1)
    columns = control[last, None], measured, share * mode[last, None]
    inputs, measurements, truth = (np.asarray(column[::every], np.float64) for column in columns)
    return LeakRecord(
        period * np.arange(0.0, steps + 1.0, every), inputs, measurements, truth, level,
        lambda: [record_of(plant, level, seed, period, kind) for kind in HEALTHY],
        lambda: [
            record_of(plant, level, 10_000 + 100 * seed + k, period, HEALTHY[0], seed)
            for k in range(plant.healthy_own)
        ],
    )  # fmt: skip


@lru_cache(maxsize=8)
def drawn(plant: Plant, seed: int, steps: int) -> tuple[float, float, Array, Array]:
    """Onset of the fault [s], its share, errors of coefficients over the largest, input signs."""
    draw = random_stream(seed, "bench", "leak", "plant")
    onset, share = draw.uniform(*plant.onset), draw.uniform(*plant.share)
    errors = draw.uniform(-1.0, 1.0, (2, 4))
    return onset, share, errors, np.asarray(2.0 * draw.integers(0, 2, steps) - 1.0, np.float64)


@lru_cache(maxsize=512)
def actuator(plant: Plant, mode: str, wrong: float, seed: int) -> ActuatorModel:
    """The model of a mode, with errors uniform within ``wrong``, the same in all modes."""
    factors = 1.0 + wrong * drawn(plant, seed, 1)[2]
    return ActuatorModel(*(np.array(getattr(plant, mode)) * factors))


@lru_cache(maxsize=8)
def healthy_records(plant: Plant, level: Level, period: float) -> tuple[LeakRecord, ...]:
    """Records to set a threshold by, of the plant that methods know."""
    seeds = range(5001, 5001 + plant.healthy)
    return tuple(record_of(plant, level, seed, period, HEALTHY[0]) for seed in seeds)
