"""The ranking of Fig. 3 over the tuning of each method."""

from __future__ import annotations

from matplotlib.figure import Figure

from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.styles import style_of
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.plotting.figures import add_note, blank, decades, few_ticks
from reobserve_papers.plotting.style_sheet import thick

_SWEPT = {
    "extended_lag": ("rho", "ρ [1/s]"),
    "least_squares": ("forgetting", "forgetting [1/s]"),
    "adaptive": ("forgetting", "forgetting [1/s]"),
    "relay": ("relay_gain", "gain M [1/s²]"),
}
# The plotted quantities, their labels, and whether the markers are filled.
_QUANTITIES = (
    ("resting_rms_delay_error", "delay at rest", False),
    ("varying_rms_delay_error", "delay varying", True),
)


def draw(data: FigureData[keys.Job]) -> Figure:
    """Plot one panel for each method, with the tuning of Fig. 3 as a dotted line."""
    job = data.job
    figure = blank(4.6)
    panels = figure.subplots(2, 2, sharey=True)
    for axes, (name, (parameter, label)) in zip(panels.ravel(), _SWEPT.items(), strict=True):
        runs = data.study.where(observer=name, sweep=parameter)
        style = style_of(job.observers[name])
        for quantity, text, filled in _QUANTITIES:
            scores = runs.where(quantity=quantity)
            face = {"markerfacecolor": style.color if filled else "none"}
            axes.loglog(scores["level"], scores["value"], **style.points(), **face, label=text)
        chosen = getattr(job.observers[name], parameter)
        if chosen > 0:
            axes.axvline(chosen, color="0.4", linewidth=thick(0.8), linestyle=":")
        axes.set_title(job.observers[name].label.replace(", a reconstruction of", ""))
        axes.set_xlabel(label)
        few_ticks(axes, runs.levels("level"))
        axes.set_ylim(1e-5, 1)
        decades(axes.yaxis)
    for axes in panels[:, 0]:
        axes.set_ylabel("RMS error of the delay [s]")
    panels[0, 0].legend(loc="lower left")
    add_note(
        figure,
        "Dotted: the tuning of Fig. 3 (left of the scale where there is no forgetting). "
        f"At rest: the last {job.metrics.late:g} s before each jump of the delay. The gain of the\n"
        "adaptive method is proportional to its forgetting. The methods with a number are "
        "reconstructions.",
    )
    return figure
