"""Causes of the differences between the SVSF-IMM's and the KF-IMM's probabilities, one at a time.

The gains of an SVSF-IMM are frozen over the time in which probabilities are compared, so that
nothing switches; or gamma is zero; or the bank is a KF-IMM. This is done for each SVSF with its own
layers, and for the first one with layers at other scales. Frozen gains are the means, or the
effective gains: means weighted by the squares of the innovations, as a gain on an innovation near
zero has no effect. The study `frozen` compares both, and filters with random gains, frozen alike.
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
from reobserve_papers.papers.imm.null import RANDOM_GAIN, RandomGainFilter, random_shares
from reobserve_papers.papers.imm.setup import bank, measured_columns, saturation
from reobserve_papers.papers.imm.setup import run as run_bank
from reobserve_papers.papers.imm.study_rows import (
    FROZEN,
    INTACT,
    KALMAN,
    SCANNED,
    STATED,
    WEIGHTED,
    ZERO_RATE,
)
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Row = tuple[str, str, float, int, str, float, str]

THREADS = 2

# Variants in the order of their rows
_CAUSES = INTACT, KALMAN, FROZEN, ZERO_RATE
_FROZEN = INTACT, FROZEN, WEIGHTED


def run(job: keys.Job, study: keys.Causes, plant: Series) -> list[Row]:
    """Rows by SVSF and scale: mean probabilities after the fault by variant, and the saturation."""

    def rows(name: str, body: keys.SmoothVariableStructure, number: int) -> list[Row]:
        banks = variants(bank(job.plant, body, plant.step))
        return list(_bank_rows(job, plant, name, body, number, banks, _CAUSES))

    tasks = list(_tasks(job, study))
    with ThreadPoolExecutor(THREADS) as pool:
        parts = pool.map(lambda task: rows(*task), tasks)
        return [row for part in parts for row in part]


def run_frozen(job: keys.Job, plant: Series) -> list[Row]:
    """Rows of each SVSF and of random gains with its layers, free to switch and frozen."""
    rows: list[Row] = []
    for name, body in _svsfs(job):
        whole = bank(job.plant, body, plant.step)
        random = tuple(RandomGainFilter(cast(KalmanFilter, svsf).model) for svsf in whole.filters)
        for who, chosen in (
            (name, whole),
            (f"{RANDOM_GAIN}_{name}", replace(whole, filters=random)),
        ):
            rows += _bank_rows(job, plant, who, body, STATED, {INTACT: chosen}, _FROZEN)
    return rows


def check(job: keys.Job) -> None:
    """Refuse observers that cannot be frozen, with an `InputError` that names them."""
    list(_svsfs(job))


def _tasks(
    job: keys.Job, study: keys.Causes
) -> Iterator[tuple[str, keys.SmoothVariableStructure, int]]:
    bodies = list(_svsfs(job))
    for name, body in bodies:
        yield name, body, STATED
    name, body = bodies[0]
    for scale in study.scales:
        yield name, replace(body, layer_scale=scale), SCANNED


def _svsfs(job: keys.Job) -> Iterator[tuple[str, keys.SmoothVariableStructure]]:
    bodies = {
        name: body
        for name, body in job.observers.items()
        if isinstance(body, keys.SmoothVariableStructure)
    }
    if not bodies:
        raise InputError("observers", "must have an SVSF")
    for name, body in bodies.items():
        if body.inverse != "pseudo":
            raise InputError(f"observers.{name}.inverse", "must be pseudo, to freeze the gain")
        yield name, body


def _bank_rows(
    job: keys.Job,
    plant: Series,
    name: str,
    body: keys.SmoothVariableStructure,
    number: int,
    banks: dict[str, IMM],
    asked: tuple[str, ...],
) -> Iterator[Row]:
    """Rows of a bank and of those of its variants that are asked for."""
    measured, held = plant["measured"][1:, measured_columns(body)], plant["input"][:-1]
    time, fault = plant.time[1:], MODES.index(job.scenario.fault)
    late = scored("metrics.after", time, *job.metrics.after, closed="right")
    since = scored("scenario.onset", time, plant.events["fault"][0], np.inf, closed="right")

    def rows(variant: str, **numbers: float) -> Iterator[Row]:
        for quantity, value in numbers.items():
            yield name, variant, body.layer_scale, number, quantity, value, "1"

    whole = run_bank(banks[INTACT], body, measured, held)
    if whole.diverged_at is None:
        banks = banks | frozen(banks[INTACT], whole["innovation"], late, asked)
    for variant in asked:
        run = whole if variant == INTACT else None
        if run is None and variant in banks:
            run = run_bank(banks[variant], body, measured, held)
        if run is None or run.diverged_at is not None:
            yield from rows(variant, normal_after=np.nan, fault_after=np.nan)
            continue
        mean = run["probability"][late].mean(axis=0)
        yield from rows(variant, normal_after=float(mean[0]), fault_after=float(mean[fault]))
    saturated, chattering = saturation(body, whole["innovation"])
    where = since[: len(saturated)]
    yield from rows(
        INTACT,
        saturation_fraction=float(np.mean(saturated[where])),
        chattering_fraction=float(np.mean(chattering[where])),
    )
    if WEIGHTED in asked:
        part = chattering[late[: len(chattering)]]
        yield from rows(INTACT, chattering_after=float(np.mean(part)) if len(part) else np.nan)


def variants(whole: IMM) -> dict[str, IMM]:
    """A bank of SVSFs, and its variants that can be built without running it."""
    filters = [cast(SmoothVariableStructureFilter, svsf) for svsf in whole.filters]
    changed: dict[str, list[ModeFilter]] = {
        KALMAN: [KalmanFilter(svsf.model) for svsf in filters],
        ZERO_RATE: [replace(svsf, convergence_rate=0.0) for svsf in filters],
    }
    return {
        INTACT: whole,
        **{name: IMM(new, whole.transition, mixing=whole.mixing) for name, new in changed.items()},
    }


def frozen(
    bank: IMM, innovation: Array, rows: Bools, asked: tuple[str, ...] = _FROZEN
) -> dict[str, IMM]:
    """Banks with constant gains, where these are stable: the means, and the effective ones."""
    banks = {}
    for variant in {FROZEN, WEIGHTED} & set(asked):
        gains = mean_gains(bank, innovation, rows, weighted=variant == WEIGHTED)
        try:
            filters = [
                FixedGainObserver(cast(KalmanFilter, member).model, gain=gain)
                for member, gain in zip(bank.filters, gains, strict=True)
            ]
        except InputError:  # the error would not decay
            continue
        banks[variant] = IMM(filters, bank.transition, mixing=bank.mixing)
    return banks


def mean_gains(bank: IMM, innovation: Array, rows: Bools, *, weighted: bool = False) -> list[Array]:
    """The mean gain of each filter over some rows, (r, n, m), from all its innovations, (k, r, m).

    A gain corrects the share s of an innovation e, by the pseudo-inverse. With ``weighted`` the
    mean is the effective gain, sum(s e^2) / sum(e^2): the constant s whose corrections s e are the
    nearest to those that were made.
    """
    gains = []
    for j, member in enumerate(bank.filters):
        shares = corrected_shares(member, innovation[:, j])[rows]
        weights = innovation[rows, j] ** 2 if weighted else np.ones_like(shares)
        total = weights.sum(axis=0)
        effective = (weights * shares).sum(axis=0) / np.where(total > 0.0, total, 1.0)
        mean = np.where(total > 0.0, effective, shares.mean(axis=0))
        gains.append(np.linalg.pinv(cast(KalmanFilter, member).model.C) * mean)
    return gains


def corrected_shares(member: ModeFilter, innovation: Array) -> Array:
    """The share of each innovation that a filter with the pseudo-inverse corrects, (k, m)."""
    if isinstance(member, RandomGainFilter):
        return random_shares(innovation)
    svsf = cast(SmoothVariableStructureFilter, member)
    # s = (|e(k+1|k)| + gamma |e(k|k)|) / max(|e(k+1|k)|, psi), e(k+1|k+1) = (1 - s) e(k+1|k)
    left, shares = np.zeros(innovation.shape[1]), np.empty(innovation.shape)
    for k, error in enumerate(innovation):
        size = np.abs(error)
        shares[k] = (size + svsf.convergence_rate * left) / np.maximum(size, svsf.boundary_layer)
        left = np.abs((1.0 - shares[k]) * error)
    return shares
