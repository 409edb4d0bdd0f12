"""Distinguishable models: detected faults against the nu-gap between two models.

The plant changes from the normal mode to a mode between this and the leakage mode, and detectors
with the two models must detect the change. Their thresholds give all of them the same share of
false alarms, on separate records without a fault. The plant is exactly one of the models, or has
the process noise Q of the filters. The runs are compiled loops that release the interpreter, so two
threads use two cores. The order of the rows is fixed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from reobserve.core.errors import InputError, located
from reobserve.core.kernel import kernel
from reobserve.core.random_streams import random_stream
from reobserve.estimation.false_alarms import false_alarm_threshold
from reobserve.observers.linear_filter import LinearFilter
from reobserve.papers.imm import keys
from reobserve.papers.imm.detectors import (
    Bank,
    Detectors,
    distances,
    likelihoods,
    rest_likelihoods,
)
from reobserve.papers.imm.nu_gap import nu_gap
from reobserve.papers.imm.setup import bank, measured_columns, modes
from reobserve.papers.imm.study_rows import DRIVEN, EXACT, sweep_name, with_scales
from reobserve.plants.hydraulic_actuator import ActuatorModel, simulate
from reobserve.replication.parameters.job import Job
from reobserve.signals.grid import multiple
from reobserve.signals.inputs import Signal
from reobserve.signals.series import Series
from reobserve.systems.linear import ModelArrays

Array = NDArray[np.float64]
Row = tuple[str, str, float, int, str, float, str]

THREADS = 2


@dataclass(frozen=True)
class Grid:
    """Numbers of steps: of a record, before the fault, of the start, and of the averaged end."""

    period: float
    steps: int
    begin: int
    settling: int
    averaged: int


@dataclass(frozen=True)
class Pair:
    """Two models, the banks that must distinguish them, and the plant that changes between them."""

    sweep: str
    share: float
    gap: float
    plant: list[ActuatorModel]
    switching_condition: str
    columns: list[int]
    banks: Mapping[str, Bank]
    control: Array
    grid: Grid
    noise: Array
    process: Array
    seed: int

    def record(self, kind: str, number: int, rows: int) -> tuple[Array, Array]:
        """The first rows of a record, (k, m), and the inputs held up to them, (k,).

        Each record has its own noise. Its input starts at a random place of the sequence, so that
        the fault occurs at any point of it.
        """
        names = self.sweep, f"{self.share:g}", kind, str(number)
        stream = random_stream(self.seed, "imm", "closeness", *names)
        begin = int(stream.integers(len(self.control) - self.grid.steps + 1))
        held = self.control[begin : begin + rows]
        mode = (np.arange(rows) >= self.grid.begin).astype(np.int64)
        motion = simulate(self.plant, mode, held, self.grid.period, self.switching_condition)
        motion = motion[1:, self.columns]
        noise = self.noise * stream.standard_normal(motion.shape)
        if not self.process.any():
            return motion + noise, held
        kicks = self.process * stream.standard_normal((rows, len(self.process)))
        filters = next(iter(self.banks.values()))[0].filters
        one, other = (cast(LinearFilter, mode).model.arrays for mode in filters)
        return motion + noise + driven(one, other, self.grid.begin, kicks), held


@kernel
def driven(one: ModelArrays, other: ModelArrays, begin: int, kicks: Array) -> Array:
    """The outputs due to process noise, at the ends of steps: shape (k, m).

    ``kicks``, (k, n), are the process noise of each step. From step ``begin`` on the other model
    applies, and the states are continuous.
    """
    n, m = kicks.shape[1], len(one.C)
    states, moved, outputs = np.zeros(n), np.empty(n), np.zeros((len(kicks), m))
    for k in range(len(kicks)):
        # Products are written out, because matrix products take seconds to compile.
        model = one if k < begin else other
        for a in range(n):
            moved[a] = kicks[k, a]
            for b in range(n):
                moved[a] += model.A[a, b] * states[b]
        for a in range(n):
            states[a] = moved[a]
            for o in range(m):
                outputs[k, o] += model.C[o, a] * states[a]
    return outputs


def run(job: Job, plant: Series) -> list[Row]:
    """Rows of each pair: its gap, thresholds, and alarm times [s] by run and detector.

    Times count from the fault: 0 or less is a false alarm, and nan is none. For banks there is also
    the mean probability of the faulty model at the end.

    Raises
    ------
    InputError
        If a setting cannot be used.
    """
    with ThreadPoolExecutor(THREADS) as pool:
        return [row for pair in _pairs(job) for row in _alarm_rows(pair, job.study, pool)]


def _pairs(job: Job) -> Iterator[Pair]:
    study, period = job.study, job.scenario.period
    observers, grid = with_scales(job.observers, study.layer_scales), _grid(study, period)
    longest = grid.steps + multiple("starts", study.starts, period, "the scenario's period")
    control = Signal.parse("input", study.input, 1)(np.arange(longest) * period)[:, 0]
    normal, _, leakage = modes(job.plant)
    columns = measured_columns(next(iter(observers.values())))
    healthy = simulate([normal], np.zeros(longest, dtype=np.int64), control, period)
    size = np.sqrt(np.mean(healthy[:, columns] ** 2, axis=0))
    for kind, level in _settings(study):
        noise = level * size
        for share in study.shares:
            models = [normal, normal.blended(leakage, share)]
            banks: dict[str, Bank] = {}
            for name, body in observers.items():
                matched = replace(body, measurement_noise=(noise**2).tolist())
                with located(f"observers.{name}"):
                    banks[name] = bank(job.plant, matched, period, models), matched
            first = next(iter(banks.values()))[0].filters[0]
            spread = np.sqrt(np.diag(first.model.arrays.Q))
            yield Pair(
                sweep_name(kind, level), share, nu_gap(*(_fraction(one) for one in models)), models,
                job.scenario.switching_condition, columns, banks, control, grid, noise,
                spread if kind == DRIVEN else np.zeros_like(spread), job.seed,
            )  # fmt: skip


def _alarm_rows(pair: Pair, study: keys.Closeness, pool: ThreadPoolExecutor) -> Iterator[Row]:
    grid = pair.grid
    first = next(iter(pair.banks.values()))
    rest = rest_likelihoods(first, grid.steps)
    numbers = range(1, study.faultless_runs + 1)
    faultless = list(pool.map(lambda number: pair.record("faultless", number, grid.begin), numbers))

    def far(record: tuple[Array, Array]) -> float:
        found = likelihoods(first, 0, *record)
        return float(np.mean(distances(rest, found)[grid.settling :]))

    expected = float(np.mean(list(pool.map(far, faultless))))
    detectors = Detectors(pair.banks, grid.settling, rest, expected)

    def maxima(record: tuple[Array, Array]) -> dict[str, float]:
        found = detectors.statistics(*record)
        return {name: float(row[grid.settling :].max()) for name, row in found.items()}

    def statistics(number: int) -> dict[str, Array]:
        return detectors.statistics(*pair.record("judged", number, grid.steps))

    peaks = list(pool.map(maxima, faultless))
    limits = {
        name: false_alarm_threshold([one[name] for one in peaks], study.false_alarm_probability)
        for name in peaks[0]
    }
    at = pair.sweep, pair.share
    yield "models", *at, 0, "nu_gap", pair.gap, "1"
    for name, limit in limits.items():
        yield name, *at, 0, "threshold", limit, "1"
    for number, found in enumerate(pool.map(statistics, range(1, study.runs + 1)), 1):
        for name, statistic in found.items():
            yield name, *at, number, "alarm_time", alarm_time(statistic, limits[name], grid), "s"
            if name in pair.banks:
                mean = float(np.mean(expit(statistic[-grid.averaged :])))
                yield name, *at, number, "probability_after", mean, "1"


def alarm_time(statistic: Array, limit: float, grid: Grid) -> float:
    """Time from the fault to the first statistic above the limit [s], without the start.

    It is nan if there is none. False alarms have 0 or less: the first row that the fault affects is
    the end of its first step.
    """
    above = statistic[grid.settling :] > limit
    if not above.any():
        return float("nan")
    return (grid.settling + int(np.argmax(above)) + 1 - grid.begin) * grid.period


def check(job: Job) -> None:
    """Refuse times that do not fit, an invalid input, and invalid models.

    Raises
    ------
    InputError
        With the key of the study.
    """
    study, period = job.study, job.scenario.period
    _grid(study, period)
    multiple("starts", study.starts, period, "the scenario's period")
    signal = Signal.parse("input", study.input, 1)
    signal.check_grid("input", period, study.starts + study.horizon)
    false_alarm_threshold(np.zeros(study.faultless_runs), study.false_alarm_probability)
    normal, _, leakage = modes(job.plant)
    for share in study.shares:
        try:
            normal.blended(leakage, share)
        except InputError as error:
            raise InputError("shares", error.problem) from None


def _grid(study: keys.Closeness, period: float) -> Grid:
    steps, begin, settling, averaged = (
        multiple(name, getattr(study, name), period, "the scenario's period")
        for name in ("horizon", "onset", "settling", "averaging_time")
    )
    for name, count in (("settling", settling), ("averaging_time", averaged)):
        if count >= begin:
            raise InputError(
                name, f"{count * period:g} s must end before the onset at {study.onset:g} s"
            )
    if begin + averaged > steps:
        raise InputError(
            "averaging_time",
            f"{study.averaging_time:g} s must fit between onset and horizon, {study.onset:g} and "
            f"{study.horizon:g} s",
        )
    return Grid(period, steps, begin, settling, averaged)


def _settings(study: keys.Closeness) -> Iterator[tuple[str, float]]:
    """Kinds of the plant, without or with process noise, and levels of its measurement noise."""
    for kind, levels in ((EXACT, study.noise_levels), (DRIVEN, study.driven_levels)):
        for level in levels:
            yield kind, level


def _fraction(model: ActuatorModel) -> tuple[Array, Array]:
    numerator, denominator = model.coefficients
    return numerator, np.concatenate([[1.0], denominator])
