"""Figs 1 and 2 of the paper: delay and states of the pendulum, their estimates and errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.notes import note
from reobserve_papers.papers.delay.scoring import errors, singular_instants, turned_over_at
from reobserve_papers.papers.delay.styles import style_of
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.plotting.figures import (
    TRUTH,
    add_note,
    decades,
    envelope,
    headroom,
    new_figure,
    thin,
    time_axis,
)
from reobserve_papers.plotting.style_sheet import points, thick
from reobserve_papers.signals.series import Series

BIN = 1.0  # [s], each drawn as its largest error: so long that dashes are seen in noise
BELOW = 0.76  # share of a panel's height below its legend
STRIP = 0.06  # height of the bars that show where a gain is off, as a share of the panel's


def draw(data: FigureData[keys.Job]) -> Figure:
    """Plot the delay, both states, and the errors of all three."""
    job, plant, estimates = data.job, data.plant, data.estimates
    figure, axes = new_figure((1.6, 1.2, 1.2, 1.35, 1.2, 1.2))
    delay, angle, rate, delay_error, *state_errors = axes
    delay.plot(*upright(plant), **TRUTH.line(), label="delay of the input")
    for i, panel in enumerate((angle, rate)):
        panel.plot(*thin(plant.time, plant["state"][:, i]), **TRUTH.line(), label="pendulum")
    for name, estimate in estimates.items():
        observer = job.observers[name]
        line = {**style_of(observer).line(), "label": observer.label}
        error = errors(plant, estimate)
        if "delay" in error:
            delay.plot(*thin(estimate.time, estimate["delay"]), **line)
            delay_error.plot(*thin(estimate.time, error["delay"]), **line)
        else:
            delay.plot([], [], **line)  # for the legend
        for i, panel in enumerate((angle, rate)):
            panel.plot(*thin(estimate.time, estimate["state"][:, i]), **line)
        for i, panel in enumerate(state_errors):
            size = np.abs(error["state"][:, i])
            panel.semilogy(*envelope(estimate.time, size, BIN), **line)
    delay.set(ylabel="delay [s]", ylim=(-0.1, 1.5))
    headroom(delay, to=2.5)
    delay.set_title("(a) delay and its estimates")
    delay.legend(loc="upper left", ncols=2)
    angle.set_ylabel("angle x₁ [rad]")
    angle.set_title("(b) angle, not wrapped: a turn adds 2π; grey: the pendulum")
    rate.set_ylabel("rate x₂ [rad/s]")
    rate.set_title("(c) rate; grey: the pendulum")
    delay_error.set(ylabel="error [s]", ylim=(-1.0, 1.0))
    delay_error.set_title("(d) error of the delay")
    each = "(largest in each second)"
    for panel, letter, word, unit in zip(
        state_errors, "ef", ("angle", "rate"), ("rad", "rad/s"), strict=True
    ):
        panel.set_ylabel(f"|error| [{unit}]")
        panel.set_title(f"({letter}) size of the error of the {word} {each}")
        decades(panel.yaxis)
    time_axis(state_errors[-1], plant.time)
    _mark_turn(angle, rate, plant)
    _mark_singular(delay_error, (delay, *state_errors), data)
    add_note(figure, note(job))
    return figure


def upright(plant: Series) -> tuple[Any, Any]:
    """The delay with vertical jumps."""
    time = np.repeat(plant.time, 2)
    values = np.column_stack([plant["delay_before"], plant["delay"]]).ravel()
    values[0] = values[1]
    keep = np.unique(np.concatenate([np.arange(0, len(time), 40), _around_jumps(plant)]))
    return time[keep], values[keep]


def _around_jumps(plant: Series) -> Any:
    rows = [round(jump / plant.step) for jump in plant.events["jumps"]]
    return np.array([2 * row + side for row in rows for side in (0, 1)], dtype=int)


def _mark_turn(angle: Axes, rate: Axes, plant: Series) -> None:
    """Mark when the pendulum turns over and, if late, scale the axes to the time before."""
    turned = turned_over_at(plant)
    if not np.isfinite(turned):
        return
    late = turned > 0.5 * plant.time[-1]
    for i, (axes, unit) in enumerate(((angle, "rad"), (rate, "rad/s"))):
        text = "turns over"
        if late:
            states = plant["state"][:, i]
            before = states[plant.time <= turned]
            text += f", then up to {np.max(np.abs(states)):.0f} {unit}, off this scale"
            margin = 0.15 * float(np.ptp(before))
            axes.set_ylim(float(before.min()) - margin, float(before.max()) + margin)
        axes.axvline(turned, color="0.4", linewidth=thick(0.8), linestyle="-.")
        axes.annotate(
            text, (turned, 0.06), (-3 if late else 3, 0), ha="right" if late else "left",
            xycoords=("data", "axes fraction"), textcoords="offset points", fontsize=points(7),
            color="0.3",
        )  # fmt: skip


def _mark_singular(first: Axes, others: tuple[Axes, ...], data: FigureData[keys.Job]) -> None:
    """Mark the zeros of u' by dotted lines, and the times with the gain off by bars."""
    instants = singular_instants(data.plant)
    for axes in (first, *others):
        top = 1.0 if axes.get_legend() is None else BELOW
        for at in instants:
            axes.axvline(at, ymax=top, color="0.4", linewidth=thick(0.8), linestyle=":")
    if len(instants):
        first.annotate(
            "u′ = 0", (instants[0], 0.86), (3, 0), fontsize=points(7), color="0.3",
            xycoords=("data", "axes fraction"), textcoords="offset points",
        )  # fmt: skip
    bars = 0
    for name, estimate in data.estimates.items():
        if "off" not in estimate.channels or not estimate["off"].any():
            continue
        bottom = 0.02 + bars * (STRIP + 0.02)
        first.fill_between(
            estimate.time, bottom, bottom + STRIP, where=estimate["off"] > 0, linewidth=0,
            color=style_of(data.job.observers[name]).color, transform=first.get_xaxis_transform(),
        )  # fmt: skip
        bars += 1
    if bars:  # explained in the title, since in a narrow panel a label would overlap a bar
        first.set_title(f"{first.get_title(loc='left')}; bars: its gain is off")
