"""Errors over time: Fig. 1 of the paper, and the same order in other forms."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reobserve.drawing.figures import (
    STYLES,
    TRUTH,
    add_note,
    decades,
    headroom,
    new_figure,
    thin,
    time_axis,
)
from reobserve.ledger.figure_data import FigureData
from reobserve.ledger.types import Job
from reobserve.scoring.responses import error_of

Array = NDArray[np.float64]

LOWEST = 1e-12  # of the errors shown


def responses(data: FigureData) -> Figure:
    """Both error components and the size of the error, for every observer of the figure."""
    figure, (first, second, size) = new_figure((1.8, 1.8, 1.8))
    for index, (name, estimate) in enumerate(data.estimates.items()):
        line = {**STYLES[index].line(), "label": data.job.observers[name].label}
        error = error_of(data.plant, estimate, "state")
        for component, axes in enumerate((first, second)):
            axes.plot(*thin(estimate.time, error[:, component]), **line)
        _size(size, estimate.time, error, line)
    first.set_ylabel("error of x₁")
    first.set_title("(a) error of the measured state, x̂₁ − x₁")
    first.legend(loc="lower right")
    second.set_ylabel("error of x₂")
    second.set_title("(b) error of the other state, x̂₂ − x₂")
    size.set_title("(c) size of the error")
    _finish(data, figure, size)
    return figure


def forms(data: FigureData) -> Figure:
    """The size of the error of every observer, and the second state as they see it."""
    figure, (state, size) = new_figure((2.2, 2.2))
    true = thin(data.plant.time, data.plant["state"][:, 1])
    state.plot(*true, **TRUTH.line(), label="Van der Pol's oscillator")
    for index, (name, estimate) in enumerate(data.estimates.items()):
        line = {**STYLES[index].line(), "label": data.job.observers[name].label}
        state.plot(*thin(estimate.time, estimate["state"][:, 1]), **line)
        _size(size, estimate.time, error_of(data.plant, estimate, "state"), line)
    state.set_ylabel("x₂ and its estimates")
    state.set_title("(a) the state that is not measured")
    state.legend(loc="upper right", ncols=2)
    headroom(state, 0.3)
    size.set_title("(b) size of the error")
    _finish(data, figure, size)
    return figure


def _size(axes: Axes, time: Array, error: Array, line: dict[str, Any]) -> None:
    axes.semilogy(*thin(time, np.linalg.norm(error, axis=1), 600), **line)


def _finish(data: FigureData, figure: Figure, axes: Axes) -> None:
    axes.set_ylabel("|x̂ − x|")
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, LOWEST), high)
    decades(axes.yaxis)
    time_axis(axes, data.plant.time)
    add_note(figure, _note(data.job))


def _note(job: Job) -> str:
    start = ", ".join(f"{value:g}" for value in job.scenario.initial_state)
    first = next(iter(job.observers.values()))
    estimate = ", ".join(f"{value:g}" for value in first.initial_estimate)
    return (
        f"x(0) = ({start}), x̂(0) = ({estimate}), L₀ = (−2, −4)ᵀ as in the paper. Chosen here: "
        f"output y = x₁, horizon {job.plant.horizon:g} s,\n"
        f"Runge-Kutta steps of {1000 * first.sampling_period:g} ms, and the nonlinear injection "
        "ℓ(y) = L₀ y + (1/3, 1/3)ᵀ y³, which makes the error exactly linear."
    )
