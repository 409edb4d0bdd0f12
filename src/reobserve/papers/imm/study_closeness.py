"""How close may two models come: correct diagnoses against the nu-gap between them.

The plant changes from the normal mode to one whose coefficients lie a share of the way to the
leakage mode. A bank of these two models must tell: each observer's, and the first one's once more
without mixing. The runs are compiled loops that let go of the interpreter, so two threads make use
of two cores; rows come in a fixed order.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError, located
from reobserve.ledger.types import Job
from reobserve.numerics.random_streams import random_stream
from reobserve.observers.imm import IMM
from reobserve.papers.imm import keys
from reobserve.papers.imm.setup import bank, measured_columns, modes
from reobserve.papers.imm.setup import run as run_bank
from reobserve.plants.hydraulic_actuator import ActuatorModel, simulate
from reobserve.synthesis.nu_gap import nu_gap
from reobserve.timeseries.grid import multiple
from reobserve.timeseries.series import Series
from reobserve.timeseries.signals import Signal

Array = NDArray[np.float64]
Row = tuple[str, str, float, int, str, float, str]

THREADS = 2


@dataclass(frozen=True)
class Task:
    """A pair of models with its record, noiseless, and the banks that must tell them apart."""

    share: float
    gap: float
    motion: Array
    banks: dict[str, IMM]


def run(job: Job, plant: Series) -> list[Row]:
    """For each share, noise, run and bank: the faulty model's mean probability at the end.

    Raises
    ------
    InputError
        If a setting cannot be used.
    """
    study, observers = job.study, _with_unmixed(job.observers)
    period = job.scenario.period
    normal, _, leakage = modes(job.plant)
    steps, begin, judged = _grid(study, period)
    control = Signal.parse("input", study.input, 1)(np.arange(steps) * period)[:, 0]
    late = (np.arange(steps) >= begin).astype(np.int64)
    rest = np.zeros(steps, dtype=np.int64)
    healthy = simulate([normal], rest, control, period)
    columns = measured_columns(next(iter(observers.values())))
    size = np.sqrt(np.mean(healthy[:, columns] ** 2, axis=0))
    # Noise changes neither the models nor the record that it is added to.
    pairs = []
    for share in study.shares:
        faulty = normal.blended(leakage, share)
        gap = nu_gap(*(_fraction(model) for model in (normal, faulty)))
        motion = simulate([normal, faulty], late, control, period)[1:, columns]
        pairs.append((share, faulty, gap, motion))
    rows: list[Row] = []
    for level in study.noise_levels:
        tasks = []
        for share, faulty, gap, motion in pairs:
            banks = {}
            for name, body in observers.items():
                told = replace(body, measurement_noise=((level * size) ** 2).tolist())
                with located(f"observers.{name}"):
                    banks[name] = bank(job.plant, told, period, [normal, faulty])
            tasks.append(Task(share, gap, motion, banks))
            rows.append(("models", f"noise_{level:g}", share, 0, "nu_gap", gap, "1"))
        for number in range(1, study.runs + 1):
            stream = random_stream(job.seed, "imm", "closeness", f"{level:g}", str(number))
            noise = level * size * stream.standard_normal((steps, len(columns)))

            def probabilities(task: Task, noise: Array = noise) -> list[float]:
                found = []
                for name, chosen in task.banks.items():
                    one = run_bank(chosen, observers[name], task.motion + noise, control)
                    # A bank that diverges has not diagnosed anything.
                    whole = one.diverged_at is None
                    mean = float(np.mean(one["probability"][-judged:, 1])) if whole else 0.0
                    found.append(mean)
                return found

            with ThreadPoolExecutor(THREADS) as pool:
                for task, means in zip(tasks, pool.map(probabilities, tasks), strict=True):
                    for name, mean in zip(observers, means, strict=True):
                        sweep = f"noise_{level:g}"
                        rows.append((name, sweep, task.share, number, "probability", mean, "1"))
    return rows


def check(job: Job) -> None:
    """Refuse times that do not fit, an input that is none, and models that cannot be had.

    Raises
    ------
    InputError
        With the key of the study.
    """
    study, period = job.study, job.scenario.period
    _grid(study, period)
    Signal.parse("input", study.input, 1).check_grid("input", period, study.horizon)
    normal, _, leakage = modes(job.plant)
    for share in study.shares:
        try:
            normal.blended(leakage, share)
        except InputError as error:
            raise InputError("shares", error.problem) from None


def _grid(study: keys.Closeness, period: float) -> tuple[int, int, int]:
    """Steps of the whole run, before the fault, and of the end that is judged."""
    steps, begin, judged = (
        multiple(name, getattr(study, name), period, "the scenario's period")
        for name in ("horizon", "onset", "judged")
    )
    if begin + judged > steps:
        raise InputError(
            "judged",
            f"{study.judged:g} s must fit between onset and horizon, {study.onset:g} and "
            f"{study.horizon:g} s",
        )
    return steps, begin, judged


def _with_unmixed(observers: Mapping[str, keys.Observer]) -> dict[str, keys.Observer]:
    """The observers, and the first one without mixing after it: what mixing does to a diagnosis."""
    first = next(iter(observers))
    unmixed = {f"{first}_unmixed": replace(observers[first], mixing=False)}
    return {first: observers[first], **unmixed, **observers}


def _fraction(model: ActuatorModel) -> tuple[Array, Array]:
    numerator, denominator = model.coefficients
    return numerator, np.concatenate([[1.0], denominator])
