"""Fig. 3 of the paper: the delay of the scalar system as four methods see it, and their errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from reobserve.drawing.figures import STYLES, TRUTH, add_note, decades, new_figure, thin
from reobserve.ledger.types import Job
from reobserve.papers.delay.plot_states import largest, upright
from reobserve.papers.delay.scoring import errors
from reobserve.scoring.metrics import Metric
from reobserve.timeseries.series import Series


def draw(
    job: Job,
    plant: Series,
    estimates: Mapping[str, Series],
    _: Sequence[Mapping[str, Any]],
    __: Sequence[Metric],
) -> Figure:
    """The estimates, and the size of their errors."""
    figure, (delay, error) = new_figure((2.7, 2.2))
    delay.plot(*upright(plant), **TRUTH.line(), label="delay of the input")
    for style, (name, estimate) in zip(STYLES, estimates.items(), strict=False):
        line = {**style.line(), "label": job.observers[name].label}
        delay.plot(*thin(estimate.time, estimate["delay"]), **line)
        error.semilogy(*largest(estimate.time, np.abs(errors(plant, estimate)["delay"])), **line)
    delay.set_ylabel("delay [s]")
    delay.set_title("(a) delay and its estimates")
    delay.set_ylim(-0.1, 2.4)
    delay.legend(loc="upper left", ncols=2)
    error.set_ylabel("|error| [s]")
    error.set_title("(b) size of the error (largest in each fifth of a second)")
    error.set_ylim(1e-5, 3)
    decades(error.yaxis)
    error.set_xlabel("time [s]")
    error.set_xlim(plant.time[0], plant.time[-1])
    add_note(
        figure,
        "The methods of [9], [12] and [26] are reconstructions: the paper cites them without "
        "equations. Their tuning is chosen here, and decides the\nranking (see the further "
        "figure). The method of [12] is given the state and its derivative, the others the state.",
    )
    return figure
