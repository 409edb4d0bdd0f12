"""Stage plot: the disturbance and its estimates."""

from reobserve_papers.plotting.figures import STYLES, TRUTH, new_figure


def lines(data):
    figure, (axes,) = new_figure((2.0,))
    axes.plot(data.plant.time, data.plant["d"], **TRUTH.line())
    for style, (name, estimate) in zip(STYLES, data.estimates.items(), strict=False):
        label = data.job.observers[name].label
        axes.plot(estimate.time, estimate["d"], **style.line(), label=label)
    axes.legend()
    return figure


LAYOUTS = {"lines": lines}
