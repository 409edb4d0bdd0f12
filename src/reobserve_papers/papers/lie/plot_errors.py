"""Errors over time: Fig. 1 of the paper, and the same order in other forms."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reobserve.core.arguments import as_kind
from reobserve_papers.metrics.responses import error_of
from reobserve_papers.papers.lie import keys
from reobserve_papers.papers.lie.styles import starts, style_of, vector
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.plotting.figures import TRUTH, add_note, decades, headroom, new_figure, thin

Array = NDArray[np.float64]

LOWEST = 1e-9  # of the errors shown: below it the step of integration shows


def responses(data: FigureData[keys.Job]) -> Figure:
    """Both error components and the size of the error, for every observer of the figure."""
    figure, (first, second, size) = new_figure((1.8, 1.8, 1.8))
    for time, error, line in errors(data):
        for component, axes in enumerate((first, second)):
            axes.plot(*thin(time, error[:, component]), **line)
    draw_sizes(size, data, _shown(data))
    first.set_ylabel("error of x₁")
    first.set_title("(a) error of x₁, x̂₁ − x₁")
    first.legend(loc="lower right", handlelength=5)  # two periods of the longest dashes
    second.set_ylabel("error of x₂")
    second.set_title("(b) error of x₂, x̂₂ − x₂")
    size.set_title("(c) size of the error")
    size.set_xlabel("time [s]")
    add_note(figure, _note(data))
    return figure


def forms(data: FigureData[keys.Job]) -> Figure:
    """Estimates of the second state, and the size of every observer's error."""
    figure, (state, size) = new_figure((2.4, 2.2))
    true = thin(data.plant.time, data.plant["state"][:, 1])
    state.plot(*true, **TRUTH.line(), label="Van der Pol's oscillator")
    for name, estimate in data.estimates.items():
        label = data.job.observers[name].label
        state.plot(
            *thin(estimate.time, estimate["state"][:, 1]), **style_of(name).line(), label=label
        )
    state.set_ylabel("x₂ and its estimates")
    state.set_title("(a) x₂")
    headroom(state, 0.75)
    state.legend(loc="upper right", ncols=2)
    draw_sizes(size, data, _shown(data))
    size.set_title("(b) size of the error")
    size.set_xlabel("time [s]")
    add_note(figure, _note(data))
    return figure


def errors(data: FigureData[keys.Job]) -> Iterator[tuple[Array, Array, dict[str, Any]]]:
    """Time, error and line of every observer of a figure."""
    for index, (name, estimate) in enumerate(data.estimates.items()):
        line = {**style_of(name, index).line(), "label": data.job.observers[name].label}
        yield estimate.time, error_of(data.plant, estimate, "state"), line


def _shown(data: FigureData[keys.Job]) -> float:
    return as_kind("figure", data.job.figure, keys.Responses).shown


def draw_sizes(axes: Axes, data: FigureData[keys.Job], shown: float) -> None:
    """The size of every observer's error, over as much time as is ``shown`` [s]."""
    for time, error, line in errors(data):
        axes.semilogy(*thin(time, np.linalg.norm(error, axis=1), 600), **line)
    axes.set_ylabel("|x̂ − x|")
    axes.set_xlim(0.0, shown)
    seen = [np.linalg.norm(error, axis=1)[time <= shown] for time, error, _ in errors(data)]
    low, high = (float(f([f(size) for size in seen])) for f in (np.min, np.max))
    axes.set_ylim(max(0.5 * low, LOWEST), 2.0 * high)
    decades(axes.yaxis)


def _note(data: FigureData[keys.Job]) -> str:
    job = data.job
    first = next(iter(job.observers.values()))
    injections = f"ℓ(y) = {vector(job.designs[first.design].injection)}"
    for observer in job.observers.values():
        if observer.design != first.design:
            other = vector(job.designs[observer.design].injection)
            injections += f";\n{observer.label}: ℓ(y) = {other}"
    return (
        f"{starts(job)}, {injections}.\n"
        f"Simulated for {job.plant.horizon:g} s, identity observers in Runge-Kutta steps of "
        f"{1000 * first.sampling_period:g} ms."
    )
