"""Cubic injections: one that converges faster than the constant gain, and how many do."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from reobserve.papers.lie.plot_errors import draw_sizes
from reobserve.papers.lie.styles import style_of
from reobserve.papers.lie.words import starts, vector
from reobserve.plotting.figures import add_note, mosaic
from reobserve.plotting.look import mark, points
from reobserve.replication.parameters.figure_data import FigureData


def draw(data: FigureData) -> Figure:
    """Errors over time, and over the square of coefficients the share of states and the median."""
    job, study = data.job, data.study
    figure, axes = mosaic(
        [["size", "size"], ["share", "ratio"]], 5.0, height_ratios=(1.0, 1.25),
        stacked={"size": 2.2, "share": 3.4, "ratio": 3.4},
    )  # fmt: skip
    size, share, ratio = axes["size"], axes["share"], axes["ratio"]
    draw_sizes(size, data)
    size.set_xlabel("time [s]")
    size.set_title("(a) size of the error from the initial state of Fig. 1")
    size.legend(loc="lower left")

    cubic = study.where(form="cubic")
    shares = cubic.where(quantity="share_better")
    _map(figure, share, shares, 100 * shares["value"], "initial states [%]", (0.0, 100.0))
    share.set_title("(b) smaller ISE than the constant gain")
    medians = cubic.where(quantity="median_ise_ratio")
    # Powers of two about one; what is beyond, or diverges, is as dark as it gets.
    doublings = np.nan_to_num(np.log2(medians["value"]), nan=_DOUBLINGS)
    image = _map(figure, ratio, medians, doublings, "median ratio", (-_DOUBLINGS, _DOUBLINGS))
    image.colorbar.set_ticks(np.arange(-_DOUBLINGS, _DOUBLINGS + 1))
    image.colorbar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{2**value:g}"))
    ratio.set_title("(c) ISE over the constant gain's")
    for panel in (share, ratio):
        _mark(panel, data)
    share.legend(loc="upper center", bbox_to_anchor=(0.5, -0.2), fontsize=points(6.5))

    note = ";\n".join(
        f"{observer.label}, ℓ(y) = {vector(job.designs[observer.design].injection)}"
        for observer in job.observers.values()
        if _cubic(job.designs[observer.design].injection)
    )
    cubic4, count = job.observers["cubic4"], job.study.coefficients
    add_note(
        figure,
        f"{starts(job)} in (a). {note[:1].upper()}{note[1:]}.\n"
        f"(b), (c): identity form of order {cubic4.order}, gain {_GAINS[cubic4.gain]}, "
        f"{count} by {count} pairs of coefficients of y³, each from {job.study.points} by "
        f"{job.study.points} initial states, but for that of the estimate.",
    )
    return figure


_DOUBLINGS = 2.0  # of the median ratio, up and down

_GAINS = {"series": "the series of L", "jacobian": "(∂S/∂x)⁻¹", "composed": "∂T/∂z at S(x)"}


def _map(
    figure: Figure, axes: Axes, rows: Any, values: Any, label: str, bounds: tuple[float, float]
) -> Any:
    """Squares of grey over the two coefficients, light where the injection does well."""
    first, second = (sorted(set(rows[name].tolist())) for name in ("x1", "x2"))
    table = np.empty((len(second), len(first)))
    for x1, x2, value in zip(rows["x1"], rows["x2"], values, strict=True):
        table[second.index(x2), first.index(x1)] = value
    good_is_high = bounds[0] == 0.0
    image = axes.pcolormesh(
        first, second, table, cmap="Greys_r" if good_is_high else "Greys",
        vmin=bounds[0], vmax=bounds[1], shading="nearest",
    )  # fmt: skip
    figure.colorbar(image, ax=axes, label=label, extend="neither" if good_is_high else "both")
    axes.set_aspect("equal")
    axes.grid(visible=False)
    axes.set_xlabel("coefficient of y³ for x₁")
    axes.set_ylabel("coefficient of y³ for x₂")
    return image


def _mark(axes: Axes, data: FigureData) -> None:
    """Where on the square the observers of the figure are."""
    for name, observer in data.job.observers.items():
        cubic = _cubic(data.job.designs[observer.design].injection)
        if cubic:
            axes.plot(
                *cubic, linestyle="", marker=style_of(name).marker, markersize=mark(8),
                color=style_of(name).color, markeredgecolor="white", label=observer.label,
            )  # fmt: skip


def _cubic(injection: Any) -> tuple[float, ...]:
    """The coefficients of y^3 by component; nothing if it has none."""
    found = [(t["component"], float(t["coefficient"])) for t in injection if t["powers"] == [3]]
    return tuple(value for _, value in sorted(found))
