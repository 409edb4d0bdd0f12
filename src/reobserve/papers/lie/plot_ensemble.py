"""Every order against the constant gain, over initial states."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from reobserve.drawing.figures import STYLES, WIDTH, add_note
from reobserve.ledger.figure_data import FigureData
from reobserve.scoring.study_table import StudyTable

MAPPED = 4  # the order of the paper's Fig. 1

_SHARES = (
    ("share_better", "smaller ISE than with the constant gain"),
    ("share_settled", "settles within the run"),
    ("share_diverged", "leaves all bounds"),
)


def draw(data: FigureData) -> Figure:
    """Shares by order, the median of the ISE ratio, and where order 4 is better."""
    job, numbers = data.job, data.metrics
    orders = job.study.orders
    figure = Figure(figsize=(WIDTH, 4.9))
    axes = figure.subplot_mosaic(
        [["shares", "plane"], ["ratio", "plane"]],
        width_ratios=(1.0, 1.1),
        height_ratios=(1.35, 1.0),
    )
    shares, ratio, plane = axes["shares"], axes["ratio"], axes["plane"]
    for style, (name, label) in zip(STYLES, _SHARES, strict=False):
        values = [100 * numbers.at("series", name, order=order) for order in orders]
        shares.plot(orders, values, **style.points(), label=label)
    shares.set_xticks(orders)
    shares.set_ylabel("share of initial states [%]")
    shares.set_ylim(-4, 155)
    shares.set_yticks([0, 25, 50, 75, 100])
    shares.set_title("(a) identity form by order")
    shares.legend(loc="upper right")
    medians = [numbers.at("series", "median_ise_ratio", order=order) for order in orders]
    ratio.plot(orders, medians, **STYLES[0].points())
    ratio.axhline(1.0, color="0.4", linewidth=0.8)
    ratio.set_ylabel("median ratio of the ISE")
    ratio.set_xlabel("order of the gain")
    ratio.set_xticks(orders)
    ratio.set_title("(b) ratio to the constant gain")

    states, better = _compare(data.study, MAPPED)
    for chosen, color, marker, label in (
        (better, STYLES[0].color, "o", "order 4 is better"),
        (~better, STYLES[1].color, "x", "the constant gain is better"),
    ):
        plane.plot(
            *states[chosen].T, linestyle="", markersize=4, color=color, marker=marker, label=label
        )
    plane.set_aspect("equal")
    plane.set_xlabel("x₁(0)")
    plane.set_ylabel("x₂(0)")
    plane.set_title("(c) order 4 by initial state")
    plane.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13))
    add_note(
        figure,
        f"{len(states)} initial states on a square of half width "
        f"{job.study.half_width:g}, estimate at the origin, "
        f"{job.plant.horizon:g} s. Grid, size and steps are chosen here.\n"
        "A gap in (b): most runs diverge.",
    )
    return figure


def _compare(study: StudyTable, order: int) -> tuple[Any, Any]:
    """The initial states, and whether the order has the smaller ISE there."""
    ise = study.where(quantity="ise")
    mapped, constant = ise.where(form="series", order=order), ise.where(form="constant")
    states = np.stack([mapped["x1"], mapped["x2"]], axis=1)
    return states, mapped["value"] < constant["value"]
