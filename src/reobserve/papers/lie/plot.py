"""Stage plot: error responses, and what the studies say of orders, ensembles and convergence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from reobserve.errors import InputError
from reobserve.metrics import Metric
from reobserve.papers.lie import plot_domain, plot_ensemble, plot_errors, plot_orders
from reobserve.series import Series

LAYOUTS = {
    "errors": plot_errors.responses,
    "forms": plot_errors.forms,
    "orders": plot_orders.draw,
    "ensemble": plot_ensemble.draw,
    "domain": plot_domain.draw,
}


def draw(
    settings: dict[str, Any],
    plant: Series,
    estimates: Mapping[str, Series],
    study: Sequence[Mapping[str, Any]] | None,
    metrics: Sequence[Metric],
) -> Figure:
    """The figure in the layout that the ledger names.

    Raises
    ------
    InputError
        If there is no such layout, or it draws a study of another method.
    """
    layout = settings["figure"]["layout"]
    if layout not in LAYOUTS:
        raise InputError("layout", f"{layout!r} must be one of {', '.join(LAYOUTS)}")
    method = settings["study"]["method"] if "study" in settings else None
    if layout in ("orders", "ensemble", "domain") and method != layout:
        raise InputError("study", f"must be one of the method {layout}, as the layout is")
    return LAYOUTS[layout](settings, plant, estimates, study or [], metrics)
