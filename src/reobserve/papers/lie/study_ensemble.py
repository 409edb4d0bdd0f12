"""Every order of both forms against the constant gain, over a grid of initial states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from reobserve.core.errors import located
from reobserve.observers.normal_form_identity import IdentityObserver
from reobserve.observers.normal_form_observer import NormalFormObserver
from reobserve.observers.normal_form_transformed import TransformedObserver
from reobserve.papers.lie.comparison import axis, records
from reobserve.papers.lie.setup import build_observer, build_system, forms
from reobserve.papers.lie.study_rows import Row
from reobserve.plants.polynomial import PolynomialPlant
from reobserve.replication.parameters.job import Job
from reobserve.signals.grid import multiple
from reobserve.signals.series import Series
from reobserve.synthesis.normal_form.gain import GAINS


def run(job: Job, _: Series, design: Mapping[str, Any]) -> list[Row]:
    """For each initial state and observer: ``ise`` [s], and ``settled`` and ``diverged`` (0, 1).

    The identity form goes by the reading of its gain, the other is called ``transformed``;
    observers of the study go by their names. The plant's own record is not used.

    Raises
    ------
    InputError
        If a setting cannot be used.
    """
    study = job.study
    with located("studies.ensemble"):
        step = study.sampling_period
        steps = multiple("sampling_period", job.plant.horizon, step, "the step")
        coordinates = axis(study.half_width, study.points)
    plant = PolynomialPlant(build_system(job.plant))
    built = _observers(job, design, step)
    estimates = [np.array(body.initial_estimate) for body in job.observers.values()]
    band = job.metrics.settling_band
    rows = []
    for record in records(plant, coordinates, estimates[0], steps, step):
        for name, order, observer in built:
            found = record.outcome(observer, estimates[0], band)
            place = (name, order, float(record.start[0]), float(record.start[1]))
            rows += [
                Row(*place, "ise", found.ise, "s"),
                Row(*place, "settled", float(found.settled), "1"),
                Row(*place, "diverged", float(found.diverged), "1"),
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
    form = known[study.design]
    for order in study.orders:
        with located("studies.ensemble.orders"):
            found += [
                *(
                    (gain, order, IdentityObserver(form, order, gain, sampling_period=step))
                    for gain in GAINS
                ),
                ("transformed", order, TransformedObserver(form, order, sampling_period=step)),
            ]
    return found
