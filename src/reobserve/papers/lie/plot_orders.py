"""Errors and Floquet exponents over the order of the gain, for its three readings."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reobserve.drawing.figures import STYLES, add_note, new_figure
from reobserve.ledger.figure_data import FigureData
from reobserve.ledger.types import Job
from reobserve.scoring.study_table import StudyTable

LABELS = {
    "series": "gain: series of L",
    "jacobian": "gain: (∂S/∂x)⁻¹",
    "composed": "gain: ∂T/∂z at S(x)",
}


def draw(data: FigureData) -> Figure:
    """ISE, settling time and largest Floquet exponent of the identity form over the order."""
    job, study = data.job, data.study
    figure, (ise, settling, floquet) = new_figure((2.0, 1.6, 2.0))
    _curves(ise, study, "ise")
    _mark_divergence(ise, study)
    ise.set_yscale("log")
    ise.yaxis.set_major_formatter("{x:g}")
    ise.set_ylabel("ISE [s]")
    ise.set_title("(a) integral of the squared error; crosses: the estimate leaves all bounds")
    ise.set_ylim(1.5, 4e3)
    ise.legend(loc="center left", bbox_to_anchor=(0.0, 0.36), ncols=3)
    _curves(settling, study, "settling_time")
    settling.set_ylabel("settling time [s]")
    settling.set_title("(b) time to 2 % of the first error; a gap: not within the run")
    _curves(floquet, study, "floquet_exponent", named=False)
    floquet.axhline(0.0, color="0.4", linewidth=0.8)
    floquet.axhline(
        study.value(form="injection", quantity="floquet_exponent"),
        color="0.4", linewidth=0.8, linestyle=":",
        label="nonlinear injection, and what the normal form aims at",
    )  # fmt: skip
    floquet.legend(loc="lower right")
    floquet.set_ylim(-2.0, 1.0)
    floquet.set_ylabel("exponent [1/s]")
    floquet.set_title(
        "(c) largest Floquet exponent of the error on the limit cycle; above 0 the error grows"
    )
    floquet.set_xlabel("order of the gain")
    floquet.set_xticks(job.study.orders)
    period = study.value(form="cycle", quantity="period")
    add_note(
        figure,
        f"Identity form from x(0) = ({_pair(job)}), estimate at the origin. Order 0 is the "
        f"constant gain; odd orders equal the even one below.\nPeriod of the limit cycle "
        f"{period:.5g} s; what is off the scale of (c) grows faster than shown.",
    )
    return figure


def _pair(job: Job) -> str:
    return ", ".join(f"{value:g}" for value in job.scenario.initial_state)


def _curves(axes: Axes, study: StudyTable, quantity: str, *, named: bool = True) -> None:
    for style, (form, label) in zip(STYLES, LABELS.items(), strict=False):
        found = study.where(form=form, quantity=quantity).by_level("order")
        values = [value for (value,) in found.values()]
        axes.plot(list(found), values, **style.points(), label=label if named else None)


def _mark_divergence(axes: Axes, study: StudyTable) -> None:
    """Crosses at the top, one row a gain, where a run diverges."""
    for place, (style, form) in enumerate(zip(STYLES, LABELS, strict=False)):
        runs = study.where(form=form, quantity="diverged_at")
        lost = runs["order"][np.isfinite(runs["value"])]
        axes.plot(
            lost, [0.95 - 0.09 * place] * len(lost), linestyle="", marker="x", markersize=5,
            color=style.color, transform=axes.get_xaxis_transform(),
        )  # fmt: skip
