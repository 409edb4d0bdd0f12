"""Stage plot: the disturbance and its estimates."""

from reobserve.figures import STYLES, TRUTH, new_figure


def draw(settings, plant, estimates, study, metrics):
    figure, (axes,) = new_figure((2.0,))
    axes.plot(plant.time, plant["d"], **TRUTH.line())
    for style, (name, estimate) in zip(STYLES, estimates.items(), strict=False):
        label = settings["observers"][name]["label"]
        axes.plot(estimate.time, estimate["d"], **style.line(), label=label)
    axes.legend()
    return figure
