"""Errors and Floquet exponents over the order of the gain, for its three readings."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reobserve.papers.lie.styles import READINGS
from reobserve.papers.lie.words import starts
from reobserve.plotting.figures import add_note, new_figure
from reobserve.plotting.look import mark, points, thick
from reobserve.replication.metrics.study_table import StudyTable
from reobserve.replication.parameters.figure_data import FigureData


def draw(data: FigureData) -> Figure:
    """ISE, settling time and largest Floquet exponent of the identity form over the order."""
    job, study = data.job, data.study
    figure, (ise, settling, floquet) = new_figure((2.0, 1.6, 2.0))
    _curves(ise, study, "ise", named=False)
    ise.set_yscale("log")
    ise.yaxis.set_major_formatter("{x:g}")
    ise.set_ylabel("ISE [s]")
    ise.set_title("(a) integral of the squared error")
    _mark_divergence(ise, study)
    _curves(settling, study, "settling_time")
    settling.set_ylabel("settling time [s]")
    band = 100 * job.metrics.settling_band
    settling.set_title(f"(b) time to {band:g} % of the first error; a gap: not within the run")
    _curves(floquet, study, "floquet_exponent", named=False)
    settling.legend(loc="upper left")
    floquet.axhline(0.0, color="0.4", linewidth=thick(0.8))
    floquet.axhline(
        study.value(form="injection", quantity="floquet_exponent"),
        color="0.4", linewidth=thick(0.8), linestyle=":",
        label="nonlinear injection",
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
        f"Identity form, {starts(job)}. Order 0 is the constant gain; odd orders equal the even "
        f"one below.\nPeriod of the limit cycle "
        f"{period:.5g} s; what is off the scale of (c) grows faster than shown.",
    )
    return figure


def _curves(axes: Axes, study: StudyTable, quantity: str, *, named: bool = True) -> None:
    for form, (style, label) in READINGS.items():
        found = study.where(form=form, quantity=quantity).by_level("order")
        values = [value for (value,) in found.values()]
        axes.plot(list(found), values, **style.points(), label=label if named else None)


def _mark_divergence(axes: Axes, study: StudyTable) -> None:
    """Crosses in a band of their own above the curves, one row a gain, where a run diverges."""
    low, high = axes.get_ylim()
    top = high * (high / low) ** 0.6
    axes.set_ylim(low, top)
    axes.axhspan(high, top, color="0.94", zorder=0)
    axes.set_yticks([tick for tick in axes.get_yticks() if low <= tick <= high])
    axes.text(
        0.995, 0.97, "the estimate leaves all bounds", fontsize=points(7), color="0.35",
        ha="right", va="top", transform=axes.transAxes,
    )  # fmt: skip
    for place, (form, (style, _)) in enumerate(READINGS.items()):
        runs = study.where(form=form, quantity="diverged_at")
        lost = runs["order"][np.isfinite(runs["value"])]
        axes.plot(
            lost, [0.9 - 0.09 * place] * len(lost), linestyle="", marker="x", markersize=mark(5),
            color=style.color, transform=axes.get_xaxis_transform(),
        )  # fmt: skip
