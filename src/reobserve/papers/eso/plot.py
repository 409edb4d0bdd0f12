"""Stage plot: a fault with its estimates and their errors, and the map of the designs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from reobserve.errors import InputError
from reobserve.metrics import Metric
from reobserve.papers.eso import plot_designs, plot_fault
from reobserve.series import Series

LAYOUTS = {
    "actuator": plot_fault.draw,
    "sensor": plot_fault.draw,
    "designs": plot_designs.draw,
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
        If there is no such layout, or it draws a study and the figure has none.
    """
    layout = settings["figure"]["layout"]
    if layout not in LAYOUTS:
        raise InputError("layout", f"{layout!r} must be one of {', '.join(LAYOUTS)}")
    if (layout == "designs") != (study is not None):
        raise InputError("study", "must be given for the layout designs, and for no other")
    return LAYOUTS[layout](settings, plant, estimates, study or [], metrics)
