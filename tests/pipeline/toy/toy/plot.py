"""Stage plot: the disturbance and its estimates."""

from reobserve.papers.toy import keys

from reobserve.drawing.figures import STYLES, TRUTH, new_figure
from reobserve.ledger.types import read_job


def draw(settings, plant, estimates, study, metrics):
    job = read_job(keys.Ledger, settings)
    figure, (axes,) = new_figure((2.0,))
    axes.plot(plant.time, plant["d"], **TRUTH.line())
    for style, (name, estimate) in zip(STYLES, estimates.items(), strict=False):
        label = job.observers[name].label
        axes.plot(estimate.time, estimate["d"], **style.line(), label=label)
    axes.legend()
    return figure
