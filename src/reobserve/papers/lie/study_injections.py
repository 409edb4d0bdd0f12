"""Cubic injections against the constant gain: which of them make its error smaller, and how often.

Remark 3.13 leaves the coefficients of a nonlinear injection free. Here those of y^3 go over a
square, one for each state, and the identity form of one order runs with each of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from reobserve.core.errors import located
from reobserve.observers.normal_form_identity import IdentityObserver
from reobserve.observers.normal_form_observer import NormalFormObserver
from reobserve.papers.lie import keys
from reobserve.papers.lie.comparison import axis, records
from reobserve.papers.lie.scoring import ratios, share_better
from reobserve.papers.lie.setup import build_observer, build_problem, build_system, forms
from reobserve.papers.lie.study_rows import Row
from reobserve.plants.polynomial import PolynomialPlant
from reobserve.replication.parameters.job import Job, named
from reobserve.signals.grid import multiple
from reobserve.signals.series import Series
from reobserve.synthesis.normal_form.design import normal_form


def run(job: Job, _: Series, design: Mapping[str, Any]) -> list[Row]:
    """For each pair of coefficients: the share of initial states that it betters, and the median.

    Thomas, Kwatny & Chang, Remark 3.13.

    ``share_better`` counts those with an integral of the squared error below that of the constant
    gain, and ``median_ise_ratio`` is over all of them, nan where most runs diverge. The same for
    the observers of the study. Order and reading of the gain are those of ``cubic4``.

    Raises
    ------
    InputError
        If a setting cannot be used.
    """
    study, observers = job.study, job.observers
    constant, cubic = (named(observers, name, keys.Identity) for name in ("constant", "cubic4"))
    step, known = study.sampling_period, forms(job, design)
    with located("studies.injections"):
        steps = multiple("sampling_period", job.plant.horizon, step, "the step")
    plant = PolynomialPlant(build_system(job.plant))
    estimate = np.array(constant.initial_estimate)
    runs = list(records(plant, axis(study.half_width, study.points), estimate, steps, step))

    def squares(observer: NormalFormObserver) -> list[float]:
        return [one.outcome(observer, estimate, job.metrics.settling_band).ise for one in runs]

    stated = {}
    for name, body in observers.items():
        with located(f"observers.{name}"):
            observer = build_observer(replace(body, sampling_period=step), known[body.design])
        stated[name] = observer.order, squares(observer)
    reference = stated["constant"][1]
    rows: list[Row] = []
    for name, (order, ise) in stated.items():
        rows += _summary((name, order, "", ""), ise, reference)
    for first, second in product(axis(study.largest, study.coefficients), repeat=2):
        ise = squares(_with_cubic(job, cubic, (first, second)))
        rows += _summary(("cubic", cubic.order, float(first), float(second)), ise, reference)
    return rows


def _with_cubic(job: Job, body: keys.Identity, cubic: tuple[float, float]) -> IdentityObserver:
    """The identity form with these coefficients of y^3, and linear terms as in the design."""
    design = job.designs[job.study.design]
    terms = [
        {"component": k + 1, "powers": [3], "coefficient": float(value)}
        for k, value in enumerate(cubic)
    ]
    injected = replace(design, injection=[*design.injection, *terms])
    problem = build_problem(job.plant, injected, degree=body.order + 1)
    form = normal_form(problem.system, problem.degree, injection=problem.injection)
    return IdentityObserver(form, body.order, body.gain, sampling_period=job.study.sampling_period)


def _summary(
    place: tuple[str, int, float | str, float | str], ise: list[float], reference: list[float]
) -> Iterator[Row]:
    median = float(np.median(ratios(ise, reference)))
    yield Row(*place, "share_better", share_better(ise, reference), "1")
    yield Row(*place, "median_ise_ratio", median if np.isfinite(median) else float("nan"), "1")
