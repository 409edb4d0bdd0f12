"""Stage plot: probabilities of the modes over time, and what the studies say of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from reobserve.errors import InputError
from reobserve.metrics import Metric
from reobserve.papers.imm import (
    plot_changes,
    plot_closeness,
    plot_neighbourhood,
    plot_probability,
)
from reobserve.series import Series

LAYOUTS = {
    "normal": plot_probability.draw,
    "leakage": plot_probability.draw,
    "neighbourhood": plot_neighbourhood.draw,
    "changes": plot_changes.draw,
    "closeness": plot_closeness.draw,
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
    if layout in ("neighbourhood", "changes", "closeness") and method != layout:
        raise InputError("study", f"must be one of the method {layout}, as the layout is")
    return LAYOUTS[layout](settings, plant, estimates, study or [], metrics)
