"""Causes of the differences between the SVSF-IMM's and the KF-IMM's probabilities, one at a time.

The gains of an SVSF-IMM are frozen at their means over the time in which probabilities are
compared, so that nothing switches; or gamma is zero; or the bank is a KF-IMM. This is done for each
SVSF with its own layers, and for the first one with layers at other scales.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.observers.fixed_gain import FixedGainObserver
from reobserve.observers.gaussian_state import ModeFilter
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve_papers.metrics.responses import scored
from reobserve_papers.papers.imm import keys
from reobserve_papers.papers.imm.keys import MODES
from reobserve_papers.papers.imm.setup import bank, measured_columns, saturation
from reobserve_papers.papers.imm.setup import run as run_bank
from reobserve_papers.papers.imm.study_rows import (
    FROZEN,
    INTACT,
    KALMAN,
    SCANNED,
    STATED,
    ZERO_RATE,
)
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]
Row = tuple[str, str, float, int, str, float, str]

THREADS = 2


def run(job: keys.Job, study: keys.Causes, plant: Series) -> list[Row]:
    """Rows by SVSF and scale: mean probabilities after the fault by variant, and the saturation.

    Raises
    ------
    InputError
        If there is no SVSF, or one has an inverse other than the pseudo-inverse.
    """
    tasks = list(_tasks(job, study))
    with ThreadPoolExecutor(THREADS) as pool:
        parts = pool.map(lambda task: list(_rows(job, plant, *task)), tasks)
        return [row for part in parts for row in part]


def check(job: keys.Job, study: keys.Causes) -> None:
    """Refuse observers that cannot be frozen, with an `InputError` that names them."""
    list(_tasks(job, study))


def _tasks(
    job: keys.Job, study: keys.Causes
) -> Iterator[tuple[str, keys.SmoothVariableStructure, int]]:
    found = {
        name: body
        for name, body in job.observers.items()
        if isinstance(body, keys.SmoothVariableStructure)
    }
    if not found:
        raise InputError("observers", "must have an SVSF")
    for name, body in found.items():
        if body.inverse != "pseudo":
            raise InputError(f"observers.{name}.inverse", "must be pseudo, to freeze the gain")
        yield name, body, STATED
    name, body = next(iter(found.items()))
    for scale in study.scales:
        yield name, replace(body, layer_scale=scale), SCANNED


def _rows(
    job: keys.Job, plant: Series, name: str, body: keys.SmoothVariableStructure, number: int
) -> Iterator[Row]:
    measured, held = plant["measured"][1:, measured_columns(body)], plant["input"][:-1]
    time, fault = plant.time[1:], MODES.index(job.scenario.fault)
    late = scored("metrics.after", time, *job.metrics.after, closed="right")
    since = scored("scenario.onset", time, plant.events["fault"][0], np.inf, closed="right")

    def rows(variant: str, **numbers: float) -> Iterator[Row]:
        for quantity, value in numbers.items():
            yield name, variant, body.layer_scale, number, quantity, value, "1"

    banks = variants(bank(job.plant, body, plant.step))
    whole = run_bank(banks[INTACT], body, measured, held)
    complete = whole.diverged_at is None
    if complete:
        gains = mean_gains(banks[INTACT], whole["innovation"], late)
        try:
            filters = [
                FixedGainObserver(cast(KalmanFilter, one).model, gain)
                for one, gain in zip(banks[INTACT].filters, gains, strict=True)
            ]
            banks[FROZEN] = IMM(filters, banks[INTACT].transition, banks[INTACT].mixing)
        except InputError:  # the error would not decay
            pass
    for variant in (INTACT, KALMAN, FROZEN, ZERO_RATE):
        found = whole if variant == INTACT else None
        if found is None and variant in banks:
            found = run_bank(banks[variant], body, measured, held)
        if found is None or found.diverged_at is not None:
            yield from rows(variant, normal_after=np.nan, fault_after=np.nan)
            continue
        mean = found["probability"][late].mean(axis=0)
        yield from rows(variant, normal_after=float(mean[0]), fault_after=float(mean[fault]))
    saturated, chattering = saturation(body, whole["innovation"])
    where = since[: len(saturated)]
    yield from rows(
        INTACT,
        saturation_fraction=float(np.mean(saturated[where])),
        chattering_fraction=float(np.mean(chattering[where])),
    )


def variants(whole: IMM) -> dict[str, IMM]:
    """A bank of SVSFs, and its variants that can be built without running it."""
    filters = [cast(SmoothVariableStructureFilter, one) for one in whole.filters]
    changed: dict[str, list[ModeFilter]] = {
        KALMAN: [KalmanFilter(one.model) for one in filters],
        ZERO_RATE: [replace(one, convergence_rate=0.0) for one in filters],
    }
    return {
        INTACT: whole,
        **{name: IMM(new, whole.transition, whole.mixing) for name, new in changed.items()},
    }


def mean_gains(bank: IMM, innovation: Array, rows: NDArray[np.bool_]) -> list[Array]:
    """The mean gain of each filter over some rows, (r, n, m), from all its innovations, (k, r, m).

    (15) with the pseudo-inverse corrects the share s of an innovation and leaves (1 - s) e.
    """
    found = []
    for j, one in enumerate(bank.filters):
        svsf = cast(SmoothVariableStructureFilter, one)
        # s = (|e(k+1|k)| + gamma |e(k|k)|) / max(|e(k+1|k)|, psi), e(k+1|k+1) = (1 - s) e(k+1|k)
        left, shares = np.zeros(bank.measurements), np.empty(innovation[:, j].shape)
        for k, error in enumerate(innovation[:, j]):
            size = np.abs(error)
            shares[k] = (size + svsf.convergence_rate * left) / np.maximum(
                size, svsf.boundary_layer
            )
            left = np.abs((1.0 - shares[k]) * error)
        found.append(np.linalg.pinv(svsf.model.C) * shares[rows].mean(axis=0))
    return found
