"""Why the SVSF-IMM's probabilities differ from the KF-IMM's: one cause changed at a time.

Of an SVSF the gain moves the means or makes the covariances, and Kalman's does the other; or the
gain is held where it is on average, so that nothing switches; or it knows no edge of the layer, or
nothing but what is outside; or it has no memory. All that for each SVSF as it is stated, and for
the first one with its layers in other units.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.observers.fixed_gain import FixedGainObserver
from reobserve.observers.imm import IMM
from reobserve.observers.linear_filter import LinearFilter
from reobserve.papers.imm import keys
from reobserve.papers.imm.hybrid_bank import KALMAN, LAW, HybridRun, run_hybrid
from reobserve.papers.imm.keys import MODES
from reobserve.papers.imm.setup import (
    bank,
    boundary_layer,
    measured_columns,
    stacked_inputs,
    start,
)
from reobserve.papers.imm.setup import run as run_bank
from reobserve.papers.imm.study_rows import (
    HELD,
    INSIDE,
    NO_MEMORY,
    OUTSIDE,
    SCANNED,
    STATED,
)
from reobserve.replication.metrics.responses import window
from reobserve.replication.parameters.job import Job
from reobserve.signals.series import Series

Array = NDArray[np.float64]
Row = tuple[str, str, float, int, str, float, str]

THREADS = 2

# Whose gain moves the means, and whose covariance tells the likelihoods.
HALVES = {
    "whole": (LAW, LAW),
    "gain": (LAW, KALMAN),
    "covariance": (KALMAN, LAW),
    "kalman": (KALMAN, KALMAN),
}
VARIANTS = (*HALVES, HELD, INSIDE, OUTSIDE, NO_MEMORY)

_NO_LAYER = 1e-12  # of a layer: what is left of it where all innovations are to be outside


def run(job: Job, plant: Series) -> list[Row]:
    """For each SVSF and unit: mean probabilities after the fault by variant, and what is outside.

    Raises
    ------
    InputError
        If there is no SVSF.
    """
    tasks = list(_tasks(job))
    with ThreadPoolExecutor(THREADS) as pool:
        parts = pool.map(lambda task: list(_rows(job, plant, *task)), tasks)
        return [row for part in parts for row in part]


def check(job: Job) -> None:
    """Refuse observers without an SVSF; `InputError` names them."""
    list(_tasks(job))


def _tasks(job: Job) -> Iterator[tuple[str, keys.SmoothVariableStructure, int]]:
    found = {
        name: body
        for name, body in job.observers.items()
        if isinstance(body, keys.SmoothVariableStructure)
    }
    if not found:
        raise InputError("observers", "must have an SVSF")
    for name, body in found.items():
        yield name, body, STATED
    name, body = next(iter(found.items()))
    for unit in job.study.units:
        yield name, replace(body, layer_unit=unit), SCANNED


def _rows(
    job: Job, plant: Series, name: str, body: keys.SmoothVariableStructure, number: int
) -> Iterator[Row]:
    columns = measured_columns(body)
    measured, held = plant["measured"][1:, columns], plant["input"][:-1]
    time, fault = plant.time[1:], MODES.index(job.scenario.fault)
    late = window(time, *job.metrics.after, closed="right")
    since = window(time, plant.events["fault"][0], np.inf, closed="right")
    layer = boundary_layer(body, len(columns))
    for variant, found in variants(job.plant, body, plant.step, measured, held):
        numbers: dict[str, float] = dict.fromkeys(
            ("normal_after", "fault_after", "fault_spread"), np.nan
        )
        if found is not None and len(found.probability) == len(measured):
            judged = found.probability[late]
            numbers = {
                "normal_after": float(judged[:, 0].mean()),
                "fault_after": float(judged[:, fault].mean()),
                "fault_spread": float(judged[:, fault].std()),
            }
        if found is not None and variant == "whole":
            outside = np.abs(found.innovation[since[: len(found.innovation)]]) > layer
            numbers["outside_share"] = float(np.mean(outside))
        for quantity, value in numbers.items():
            yield name, variant, body.layer_unit, number, quantity, value, "1"


def variants(
    plant: keys.Plant,
    body: keys.SmoothVariableStructure,
    period: float,
    measured: Array,
    held: Array,
) -> Iterator[tuple[str, HybridRun | None]]:
    """Runs of all `VARIANTS` of an SVSF-IMM in their order; None for one that cannot be had."""
    chosen = bank(plant, body, period)
    state = start(chosen, body, float(held[0]))
    inputs = np.vstack([[held[0], 0.0], stacked_inputs(held)])
    whole = run_hybrid(chosen, LAW, LAW, state, measured, inputs)
    for variant, (gain, covariance) in HALVES.items():
        same = (gain, covariance) == (LAW, LAW)
        yield (
            variant,
            whole if same else run_hybrid(chosen, gain, covariance, state, measured, inputs),
        )
    yield HELD, held_gains(chosen, body, whole.mean_gain, measured, held)
    layer = boundary_layer(body, chosen.measurements)
    yield INSIDE, run_hybrid(chosen, LAW, LAW, state, measured, inputs, unsaturated=layer)
    for variant, changed in (
        (OUTSIDE, replace(body, layer_factor=_NO_LAYER * body.layer_factor)),
        (NO_MEMORY, replace(body, memory=0.0)),
    ):
        other = bank(plant, changed, period)
        yield variant, run_hybrid(other, LAW, LAW, state, measured, inputs)


def held_gains(
    chosen: IMM, body: keys.Observer, gains: Array, measured: Array, held: Array
) -> HybridRun | None:
    """The bank with constant gains, (r, n, m), if they are stable."""
    models = [one.model for one in chosen.filters if isinstance(one, LinearFilter)]
    try:
        filters = [FixedGainObserver(*pair) for pair in zip(models, gains, strict=True)]
    except InputError:
        return None
    found = run_bank(IMM(filters, chosen.transition, chosen.mixing), body, measured, held)
    return HybridRun(found["probability"], found["innovation"], gains)
