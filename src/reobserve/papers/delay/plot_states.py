"""Figs 1 and 2 of the paper: delay and states of the pendulum, their estimates and errors."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reobserve.drawing.figures import (
    STYLES,
    TRUTH,
    add_note,
    decades,
    envelope,
    new_figure,
    thin,
    time_axis,
)
from reobserve.ledger.figure_data import FigureData
from reobserve.ledger.types import Job
from reobserve.papers.delay.scoring import errors, turned_over_at
from reobserve.timeseries.series import Series

BIN = 0.2  # [s], of which the largest error is drawn


def draw(data: FigureData) -> Figure:
    """Delay, both states, and the errors of delay and angle."""
    job, plant, estimates = data.job, data.plant, data.estimates
    figure, axes = new_figure((1.6, 1.35, 1.35, 1.35, 1.35))
    delay, angle, rate, delay_error, angle_error = axes
    labels = {name: job.observers[name].label for name in estimates}
    delay.plot(*upright(plant), **TRUTH.line(), label="delay of the input")
    for i, panel in enumerate((angle, rate)):
        panel.plot(*thin(plant.time, plant["state"][:, i]), **TRUTH.line(), label="pendulum")
    for style, (name, estimate) in zip(STYLES, estimates.items(), strict=False):
        error, line = errors(plant, estimate), style.line()
        if "delay" in error:
            delay.plot(*thin(estimate.time, estimate["delay"]), **line, label=labels[name])
            delay_error.plot(*thin(estimate.time, error["delay"]), **line)
        for i, panel in enumerate((angle, rate)):
            panel.plot(*thin(estimate.time, estimate["state"][:, i]), **line, label=labels[name])
        size = np.abs(error["state"][:, 0])
        angle_error.semilogy(*envelope(estimate.time, size, BIN), **line, label=labels[name])
    delay.set_ylabel("delay [s]")
    delay.set_title("(a) delay and its estimates")
    delay.set_ylim(-0.1, 2.3)
    delay.legend(loc="upper left", ncols=3)
    angle.set_ylabel("angle x₁ [rad]")
    angle.set_title("(b) angle, not wrapped: a turn adds 2π")
    rate.set_ylabel("rate x₂ [rad/s]")
    rate.set_title("(c) rate")
    delay_error.set_ylabel("error [s]")
    delay_error.set_ylim(-1.0, 1.0)
    delay_error.set_title("(d) error of the delay")
    angle_error.set_ylabel("|error| [rad]")
    angle_error.set_title("(e) size of the error of the angle (largest in each fifth of a second)")
    decades(angle_error.yaxis)
    angle_error.legend(loc="upper right", ncols=3)
    low, high = angle_error.get_ylim()
    angle_error.set_ylim(low, 30 * high)
    time_axis(angle_error, plant.time)
    _mark_turn(angle, rate, plant)
    add_note(figure, _note(job))
    return figure


def upright(plant: Series) -> tuple[Any, Any]:
    """The delay with its jumps upright."""
    time = np.repeat(plant.time, 2)
    values = np.column_stack([plant["delay_before"], plant["delay"]]).ravel()
    values[0] = values[1]
    keep = np.unique(np.concatenate([np.arange(0, len(time), 40), _around_jumps(plant)]))
    return time[keep], values[keep]


def _around_jumps(plant: Series) -> Any:
    rows = [round(jump / plant.step) for jump in plant.events["jumps"]]
    return np.array([2 * row + side for row in rows for side in (0, 1)], dtype=int)


def _mark_turn(angle: Axes, rate: Axes, plant: Series) -> None:
    """When the pendulum turns over; what comes after a late turn must not flatten all before."""
    turned = turned_over_at(plant)
    if not np.isfinite(turned):
        return
    late = turned > 0.5 * plant.time[-1]
    text = "turns over"
    if late:
        text += f" and ends at {plant['state'][-1, 0]:.0f} rad"
        for i, axes in enumerate((angle, rate)):
            before = plant["state"][plant.time <= turned, i]
            room = 0.15 * float(np.ptp(before))
            axes.set_ylim(float(before.min()) - room, float(before.max()) + room)
    angle.axvline(turned, color="0.4", linewidth=0.8, linestyle=":")
    angle.annotate(
        text, (turned, 0.06), (-3 if late else 3, 0), ha="right" if late else "left", fontsize=7,
        xycoords=("data", "axes fraction"), textcoords="offset points", color="0.3",
    )  # fmt: skip


def _note(job: Job) -> str:
    scenario = job.scenario
    first = next(iter(job.observers.values()))
    noise = "no noise"
    if scenario.output_noise > 0 or scenario.input_noise > 0:
        noise = (
            f"noise of {scenario.output_noise:g} rad and {scenario.input_noise:g} N m, "
            f"held for {1000 * job.plant.noise_period:g} ms"
        )
    return (
        f"ρ = {first.rho:g}, τ̂(0), x(0), x̂(0), S(0) of Table I. Chosen here: {noise},\n"
        f"the dynamic equation of S, Runge-Kutta steps of {1000 * first.sampling_period:g} ms, and "
        "that below the threshold only the gain of the delay is switched off."
    )
