"""Stage study: many runs and series over one plant, as one long table.

The ``method`` of a study is one of

    orders      errors of the identity form over order and gain, and its Floquet exponents
    ensemble    every order compared with the constant gain over a grid of initial states
    injections  cubic injections compared with the constant gain over such a grid
    domain      where the series converge, and their errors on the limit cycle
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reobserve.core.errors import located
from reobserve.observers.normal_form import IdentityObserver
from reobserve.synthesis.normal_form.transform import NormalForm
from reobserve_papers.papers.lie import ensemble, keys, study_domain, study_orders
from reobserve_papers.papers.lie.study_rows import Row
from reobserve_papers.signals.series import Series


def run(job: keys.Job, plant: Series, design: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The rows of the study's method, with the columns of `Row`."""
    return [row._asdict() for row in _rows(job, plant, design)]


def _rows(job: keys.Job, plant: Series, design: Mapping[str, Any]) -> list[Row]:
    match job.study:
        case keys.OrdersStudy() as study:
            return study_orders.run(job, study, plant, design)
        case keys.EnsembleStudy() as study:
            return ensemble.run(job, study, design)
        case keys.InjectionsStudy() as study:
            return ensemble.run_injections(job, study, design)
        case keys.DomainStudy() as study:
            return study_domain.run(job, study, plant, design)


def check_study(study: keys.Study, form: NormalForm) -> None:
    """Raise the `InputError` that the study would raise for its orders."""
    if isinstance(study, keys.OrdersStudy | keys.EnsembleStudy):
        for order in study.orders:
            with located("orders"):
                IdentityObserver(form, order=order, sampling_period=1.0)
