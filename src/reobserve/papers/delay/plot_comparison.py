"""Fig. 3 of the paper: the delay of the scalar system as four methods see it, and their errors."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from reobserve.papers.delay.plot_states import BIN, upright
from reobserve.papers.delay.styles import style_of
from reobserve.plotting.figures import (
    TRUTH,
    add_note,
    decades,
    envelope,
    headroom,
    new_figure,
    thin,
    time_axis,
)
from reobserve.replication.metrics.responses import error_of
from reobserve.replication.parameters.figure_data import FigureData


def draw(data: FigureData) -> Figure:
    """The estimates, and the size of their errors."""
    plant = data.plant
    figure, (delay, error) = new_figure((2.7, 2.2))
    delay.plot(*upright(plant), **TRUTH.line(), label="delay of the input")
    for name, estimate in data.estimates.items():
        observer = data.job.observers[name]
        line = {**style_of(observer).line(), "label": observer.label}
        delay.plot(*thin(estimate.time, estimate["delay"]), **line)
        size = np.abs(error_of(plant, estimate, "delay"))
        error.semilogy(*envelope(estimate.time, size, BIN), **line)
    delay.set_ylabel("delay [s]")
    delay.set_title("(a) delay and its estimates")
    delay.set_ylim(-0.1, 1.6)
    headroom(delay, to=2.4)
    delay.legend(loc="upper left", ncols=2)
    error.set_ylabel("|error| [s]")
    error.set_title("(b) size of the error (largest in each fifth of a second)")
    error.set_ylim(1e-5, 3)
    decades(error.yaxis)
    time_axis(error, plant.time)
    add_note(
        figure,
        "The methods of [9], [12] and [26] are reconstructions: the paper cites them without "
        "equations. Their tuning is chosen here; fig3_tuning has others.\n"
        "The method of [12] is given the state and its derivative, the others the state.",
    )
    return figure
