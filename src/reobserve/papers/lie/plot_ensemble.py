"""Every order of both forms against the constant gain, over initial states."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reobserve.papers.lie.styles import FORMS, style_of
from reobserve.papers.lie.words import pair
from reobserve.plotting.figures import add_note, headroom, mosaic
from reobserve.plotting.look import mark
from reobserve.replication.metrics.study_table import StudyTable
from reobserve.replication.parameters.figure_data import FigureData


def draw(data: FigureData) -> Figure:
    """Shares by order that settle and that are better, and where the order of Fig. 1 is better."""
    job = data.job
    mapped, estimate = job.observers["order4"].order, job.observers["order4"].initial_estimate
    figure, axes = mosaic(
        [["settled", "plane"], ["better", "plane"]], 4.9, height_ratios=(1.45, 1.0),
        stacked={"settled": 2.2, "better": 2.0, "plane": 3.8},
    )  # fmt: skip
    settled, better, plane = axes["settled"], axes["better"], axes["plane"]
    _shares(settled, data, "share_settled")
    settled.set_title(f"(a) settles within {job.plant.horizon:g} s")
    settled.set_ylim(-4, 104)
    headroom(settled, to=190)
    settled.set_yticks([0, 25, 50, 75, 100])
    settled.legend(loc="upper right")
    _shares(better, data, "share_better")
    better.set_title("(b) smaller ISE than the constant gain")
    better.set_ylim(-2, 52)
    better.set_xlabel("order")

    states, smaller = _compare(data.study, mapped)
    for chosen, observer, marker, label in (
        (smaller, "order4", "o", f"order {mapped} has the smaller ISE"),
        (~smaller, "constant", "x", "the constant gain has it"),
    ):
        plane.plot(
            *states[chosen].T, linestyle="", markersize=mark(4), marker=marker, label=label,
            color=style_of(observer).color,
        )  # fmt: skip
    plane.set_aspect("equal")
    plane.set_xlabel("x₁(0)")
    plane.set_ylabel("x₂(0)")
    plane.set_title(f"(c) order {mapped}, series of L, by initial state")
    plane.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13))
    add_note(
        figure,
        f"{len(states)} initial states on a square of half width {job.study.half_width:g}, "
        f"x̂(0) = {pair(estimate)}, {job.plant.horizon:g} s. Grid, size and steps are chosen here.\n"
        f"Settled: |e| stays within {100 * job.metrics.settling_band:g} % of its first value.",
    )
    return figure


def _shares(axes: Axes, data: FigureData, quantity: str) -> None:
    orders = data.job.study.orders
    for form, (style, label) in FORMS.items():
        values = [100 * data.metrics.at(form, quantity, order=order) for order in orders]
        axes.plot(orders, values, **style.points(), label=label)
    axes.set_xticks(orders)
    axes.set_ylabel("initial states [%]")


def _compare(study: StudyTable, order: int) -> tuple[Any, Any]:
    """The initial states, and whether the order has the smaller ISE there."""
    ise = study.where(quantity="ise")
    mapped, constant = ise.where(form="series", order=order), ise.where(form="constant")
    states = np.stack([mapped["x1"], mapped["x2"]], axis=1)
    return states, mapped["value"] < constant["value"]
