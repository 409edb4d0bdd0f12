"""The error of the delay against rho, for both Taylor orders, without and with noise.

Derivatives of the input are exact here, so that what is seen is the observer's and not the
differentiator's. The runs are compiled loops that let go of the interpreter, so two threads make
use of two cores; the rows come in a fixed order whatever their number.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import located
from reobserve.core.random_streams import random_stream
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.fixed_step import run_on_halves
from reobserve.papers.delay import noise
from reobserve.papers.delay.observe import build_extended
from reobserve.papers.delay.plant import simulate
from reobserve.replication.metrics.responses import root_mean_square
from reobserve.replication.parameters.job import Job
from reobserve.signals.grid import stride
from reobserve.signals.series import Series

Array = NDArray[np.float64]
Row = tuple[str, str, float, int, str, float, str]

THREADS = 2


def run(job: Job, plant: Series) -> list[Row]:
    """For each observer, rho and run: RMS errors of delay and angle; run 0 is without noise.

    They are counted where the delay varies and the input is not near an instant at which it
    does not change.

    Raises
    ------
    InputError
        If a setting cannot be used.
    """
    study = job.study
    if job.scenario.noise_share > 0 and job.plant.noisy_input == "applied":
        # Each run draws noise of its own, and it stays with what is measured.
        plant = simulate(replace(job, scenario=replace(job.scenario, noise_share=0.0)))
    tasks = []
    for (name, body), rho in product(job.observers.items(), study.rhos):
        # Errors are counted long after the dynamic gain has come to rest at the algebraic one.
        changed = replace(
            body, rho=rho, sampling_period=study.sampling_period, initial_matrix="algebraic"
        )
        with located(f"observers.{name}"):
            tasks.append((name, rho, build_extended(Job(job.plant, observer=changed))))
    every = stride(job.plant, study.sampling_period)
    scored = _scored(plant, study.away)[:: 2 * every]
    true = plant["delay"][:: 2 * every], plant["state"][:: 2 * every, 0]
    rates = plant["input_derivatives"][::every]
    first = next(iter(job.observers.values()))
    start = (first.initial_estimate, first.initial_delay)
    rows: list[Row] = []
    with ThreadPoolExecutor(THREADS) as pool:
        for number in range(study.runs + 1):
            y, u = _measured(job, plant, number, every)

            def errors(
                task: tuple[str, float, ExtendedHighGainObserver], y: Any = y, u: Any = u
            ) -> list[Array]:
                observer = task[2]
                inputs = [np.column_stack([part, rates[:, : observer.order]]) for part in u]
                found = run_on_halves(
                    observer, y[0], inputs[0], state=observer.init(*start), y_before=y[1],
                    u_before=inputs[1],
                )  # fmt: skip
                estimates = (found["delay"], found["state"][:, 0])
                return [
                    root_mean_square((estimate - truth)[scored])
                    for estimate, truth in zip(estimates, true, strict=True)
                ]

            for (name, rho, _), (delay, angle) in zip(tasks, pool.map(errors, tasks), strict=True):
                sweep = "noise_rho" if number else "rho"
                rows.append((name, sweep, rho, number, "rms_delay_error", float(delay), "s"))
                rows.append((name, sweep, rho, number, "rms_angle_error", float(angle), "rad"))
    return rows


def _scored(plant: Series, away: float) -> NDArray[np.bool_]:
    """Where the delay varies and the input is ``away`` seconds from not changing."""
    rate = plant["input_derivatives"][:, 0]
    turning = plant.time[1:][np.sign(rate[1:]) != np.sign(rate[:-1])]
    near = np.zeros(len(plant.time), dtype=bool)
    for instant in turning:
        near |= np.abs(plant.time - instant) < away
    # The last jump is forgotten by then, too.
    return ~near & (plant.time > max(plant.events["jumps"], default=0.0) + away)


def _measured(
    job: Job, plant: Series, number: int, every: int
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """y and u of a run, each with its limits from the left; run 0 has no noise."""
    sizes = noise.deviations(
        job.plant, job.scenario.noise_share, plant["state"][:, 0], plant["input"]
    )
    found = []
    cleans = plant["state"][:, 0], plant["input"]
    for name, clean, size in zip(("output", "input"), cleans, sizes, strict=True):
        right = left = np.ascontiguousarray(clean[::every])
        if number:
            stream = random_stream(job.seed, "delay", "tradeoff", name, str(number))
            unit = noise.drawn(job.plant, stream, len(plant.time), 2 * every)
            right, left = ((clean + size * part)[::every] for part in unit)
        found.append((right, left))
    return found[0], found[1]
