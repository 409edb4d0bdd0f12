"""Stage study: many runs and series over one plant, as one long table.

The ``method`` of a study in the ledger is one of

    orders      errors of the identity form over order and gain, and its Floquet exponents
    ensemble    every order against the constant gain over a grid of initial states
    domain      where the series converge, and what they are worth on the limit cycle
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from reobserve.errors import InputError, located
from reobserve.observers.normal_form_identity import IdentityObserver
from reobserve.papers.lie import study_domain, study_ensemble, study_orders
from reobserve.papers.lie.setup import whole
from reobserve.papers.lie.study_rows import HEADER, KINDS, Row
from reobserve.series import Series
from reobserve.synthesis.normal_form.design import NormalForm

__all__ = ["HEADER", "KINDS", "run"]

METHODS = {
    "orders": study_orders.run,
    "ensemble": study_ensemble.run,
    "domain": study_domain.run,
}


def run(settings: dict[str, Any], plant: Series, design: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The rows of the study's method, with the columns of `HEADER`.

    Raises
    ------
    InputError
        If there is no such method or a setting cannot be used.
    """
    method = settings["study"].get("method", "")
    if method not in METHODS:
        raise InputError("studies.method", f"{method!r} must be one of {', '.join(METHODS)}")
    rows: list[Row] = METHODS[method](settings, plant, design)
    return [row._asdict() for row in rows]


def check_study(study: dict[str, Any], form: NormalForm) -> None:
    """Raise the `InputError` that the study would raise for its method, orders and degree."""
    if study.get("method") not in METHODS:
        raise InputError("method", f"{study.get('method')!r} must be one of {', '.join(METHODS)}")
    for order in study.get("orders", ()):
        with located("orders"):
            IdentityObserver(form, whole("order", order, 0), 1.0)
    if study["method"] == "domain":
        whole("degree", study["degree"], study_domain.LEAST_DEGREE)
