"""Figs 5 to 8 of the paper: probabilities of modes over time, and the plant or the layers."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import NDArray

from reobserve_papers.papers.imm import keys
from reobserve_papers.papers.imm.keys import MODES
from reobserve_papers.papers.imm.notes import INPUT, VELOCITY, note, style_of
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.plotting.figures import PaperFigure, add_note, new_figure, thin, time_axis
from reobserve_papers.plotting.style_sheet import points, thick

Array = NDArray[np.float64]


def draw(data: FigureData[keys.Job]) -> Figure:
    """The mode's probability with the values that the paper quotes, friction, and the velocity."""
    figure, (wanted, friction, motion) = new_figure((2.5, 1.2, 1.2))
    layout = data.job.figure.layout
    _probabilities(wanted, data, layout, "a")
    _quoted(wanted, data, layout)
    _probabilities(friction, data, "friction", "b")
    plant = data.plant
    unit = data.job.scenario.input_unit
    motion.plot(*thin(plant.time, plant["input"], 600), **INPUT.line(), label=f"input [{unit}]")
    motion.plot(*thin(plant.time, plant["motion"][:, 1], 600), **VELOCITY.line(),
                label="velocity [y]")  # fmt: skip
    motion.set_ylabel("velocity, input")
    motion.set_title("(c) the plant")
    motion.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)
    return _finished(figure, data)


def draw_switching(data: FigureData[keys.Job]) -> Figure:
    """Normal and leakage mode, and the share of the innovations outside the layers."""
    figure, (normal, leakage, outside) = new_figure((2.0, 2.0, 1.3))
    for axes, mode, letter in ((normal, "normal", "a"), (leakage, "leakage", "b")):
        _probabilities(axes, data, mode, letter)
        _quoted(axes, data, mode)
    for name, estimate in data.estimates.items():
        if "saturated" in estimate.channels:
            style = style_of(data.job.observers[name])
            outside.plot(*binned(estimate.time, estimate["saturated"])[::2], **style.line())
    outside.set_ylabel("share outside")
    outside.set_title("(c) innovations outside the boundary layer")
    return _finished(figure, data)


def _probabilities(axes: Axes, data: FigureData[keys.Job], mode: str, letter: str) -> None:
    """Means and bands of a mode, one curve a bank."""
    index = MODES.index(mode)
    for name, estimate in data.estimates.items():
        body: keys.Observer = data.job.observers[name]
        style = style_of(body)
        time, low, mean, high = binned(estimate.time, estimate["probability"][:, index])
        axes.fill_between(time, low, high, color=style.color, alpha=0.15, linewidth=0)
        axes.plot(time, mean, **style.line(), label=body.label)
    axes.set_ylim(-0.04, 1.08)
    axes.set_ylabel("probability")
    axes.set_title(f"({letter}) {mode} mode")


def _quoted(axes: Axes, data: FigureData[keys.Job], mode: str) -> None:
    """The quoted value of each bank: a pale bar where it is compared, and a mark in the margin."""
    start, end = data.job.metrics.after
    for name in data.estimates:
        body = data.job.observers[name]
        value = body.quoted[("normal", "leakage").index(mode)]
        color = style_of(body).color
        axes.plot(
            (start, end), (value, value), color=color, linewidth=thick(6), alpha=0.3,
            solid_capstyle="butt", zorder=1,
        )  # fmt: skip
        axes.annotate(
            f"◂ {value:g}", (1.0, value), xycoords=("axes fraction", "data"),
            xytext=(2, 0), textcoords="offset points", va="center", color=color,
            fontsize=points(7.5),
        )  # fmt: skip


def _finished(figure: PaperFigure, data: FigureData[keys.Job]) -> Figure:
    onset = next(iter(data.estimates.values())).events["fault"][0]
    for axes in figure.axes:
        axes.axvline(onset, color="0.4", linewidth=thick(0.8), linestyle=":")
    first = figure.axes[0]
    first.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)
    time_axis(figure.axes[-1], data.plant.time)
    add_note(figure, note(data.job))
    engine = figure.get_layout_engine()
    if isinstance(engine, ConstrainedLayoutEngine):
        engine.set(w_pad=0.1)  # [in] space beside the values in the margin
    return figure


def binned(time: Array, values: Array, width: float = 0.03) -> tuple[Array, Array, Array, Array]:
    """Time, and minimum, mean and maximum of each bin of ``width`` seconds.

    A probability that flips from sample to sample shows as a band with its mean in it.
    """
    size = max(1, round(width / (time[1] - time[0])))
    count = len(time) // size
    block = values[: count * size].reshape(count, size)
    middle = time[: count * size].reshape(count, size).mean(axis=1)
    return middle, block.min(axis=1), block.mean(axis=1), block.max(axis=1)
