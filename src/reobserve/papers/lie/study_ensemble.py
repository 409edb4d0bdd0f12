"""Every order against the constant gain, over a grid of initial states and from the same estimate.

All runs are compiled: a plant and its observers over twenty seconds take some milliseconds each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from reobserve.errors import DivergenceError, located
from reobserve.ledger.types import Job
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.normal_form_identity import IdentityObserver
from reobserve.observers.normal_form_observer import NormalFormObserver
from reobserve.papers.lie.scoring import integral_of_squares, settling_time
from reobserve.papers.lie.setup import build_observer, build_system
from reobserve.papers.lie.study_rows import Row, forms
from reobserve.plants.polynomial import PolynomialPlant
from reobserve.timeseries.grid import multiple
from reobserve.timeseries.series import Series


def run(job: Job, _: Series, design: Mapping[str, Any]) -> list[Row]:
    """For each initial state and observer: ``ise`` [s], and ``settled`` and ``diverged`` (0, 1).

    The identity form of order k with the series gain is called ``series``; observers of the
    study go by their names. The plant's own record is not used.

    Raises
    ------
    InputError
        If a setting cannot be used.
    """
    study = job.study
    with located("studies.ensemble"):
        step = study.sampling_period
        steps = multiple("sampling_period", job.plant.horizon, step, "the step")
        axis = np.linspace(-1.0, 1.0, study.points)
        axis *= study.half_width
    plant = PolynomialPlant(build_system(job.plant))
    built = _observers(job, design, step)
    estimates = [np.array(body.initial_estimate) for body in job.observers.values()]
    band = job.metrics.settling_band
    rows = []
    for point in product(axis, repeat=plant.system.states):
        start = np.array(point)
        if np.array_equal(start, estimates[0]):
            continue  # no error to begin with
        try:
            states = plant.simulate(start, 0.5 * step, 2 * steps)
        except DivergenceError as problem:
            raise DivergenceError(f"plant from {point}", problem.time) from None
        output = plant.output(states)
        for name, order, observer in built:
            result = run_on_halves(
                observer, output, state=observer.init(estimates[0]), on_divergence="return"
            )
            error = result["state"] - states[::2][: len(result)]
            diverged = result.diverged_at is not None
            settled = not diverged and np.isfinite(settling_time(error, step, band))
            squares = np.nan if diverged else float(integral_of_squares(error, step).sum())
            place = (name, order, float(point[0]), float(point[1]))
            rows += [
                Row(*place, "ise", squares, "s"),
                Row(*place, "settled", float(settled), "1"),
                Row(*place, "diverged", float(diverged), "1"),
            ]
    return rows


def _observers(
    job: Job, design: Mapping[str, Any], step: float
) -> list[tuple[str, int, NormalFormObserver]]:
    study = job.study
    known = forms(job, design)
    found: list[tuple[str, int, NormalFormObserver]] = []
    for name, body in job.observers.items():
        with located(f"observers.{name}"):
            built = build_observer(replace(body, sampling_period=step), known[body.design])
        found.append((name, built.order, built))
    for order in study.orders:
        with located("studies.ensemble.orders"):
            observer = IdentityObserver(known[study.design], order, step)
        found.append(("series", order, observer))
    return found
