"""Fig. 3 of the paper: the delay of the scalar system by four methods, and their errors."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from reobserve_papers.metrics.responses import error_of
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.plot_states import upright
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

CLOSE = 4.0  # [s] before a jump, to show an oscillation


def draw(data: FigureData[keys.Job]) -> Figure:
    """Plot the estimates, the absolute errors, and the errors before a jump on a larger scale."""
    plant = data.plant
    figure, (delay, error, close) = new_figure((2.5, 2.0, 1.5), share_time=False)
    delay.plot(*upright(plant), **TRUTH.line(), label="delay of the input")
    for name, estimate in data.estimates.items():
        observer = data.job.observers[name]
        line = {**style_of(observer).line(), "label": observer.label}
        delay.plot(*thin(estimate.time, estimate["delay"]), **line)
        off = error_of(plant, estimate, "delay")
        error.semilogy(*envelope(estimate.time, np.abs(off), 0.2), **line)
        close.plot(estimate.time, off, **line)
    delay.set_ylabel("delay [s]")
    delay.set_title("(a) delay and its estimates")
    delay.set_ylim(-0.1, 1.6)
    headroom(delay, to=2.4)
    delay.legend(loc="upper left", ncols=2)
    error.set_ylabel("|error| [s]")
    error.set_title("(b) size of the error (largest in each fifth of a second)")
    error.set_ylim(1e-5, 3)
    decades(error.yaxis)
    for axes in (delay, error):
        time_axis(axes, plant.time)
    delay.set_xlabel("")
    jump = max(plant.events["jumps"], key=lambda at: plant["delay"][round(at / plant.step) - 1])
    close.set(xlabel="time [s]", xlim=(jump - CLOSE, jump - 4 * plant.step), ylim=(-0.015, 0.015))
    close.set_ylabel("error [s]")
    close.set_title("(c) error before the jump from the largest constant delay")
    add_note(
        figure,
        "The methods of [9], [12] and [26] are reconstructions: the paper cites them without "
        "equations. Their tuning is chosen here; fig3_tuning has others.\n"
        "The method of [12] is given the state and its derivative, the others the state.",
    )
    return figure
