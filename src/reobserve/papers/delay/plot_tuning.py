"""The ranking of Fig. 3 over the tuning of each method."""

from __future__ import annotations

from matplotlib.figure import Figure

from reobserve.drawing.figures import STYLES, WIDTH, add_note, decades, few_ticks
from reobserve.ledger.figure_data import FigureData

_SWEPT = {
    "extended_lag": ("rho", "ρ [1/s]"),
    "least_squares": ("forgetting", "forgetting [1/s]"),
    "adaptive": ("forgetting", "forgetting [1/s]"),
    "relay": ("relay_gain", "gain M [1/s²]"),
}
_QUANTITIES = (
    ("resting_rms_delay_error", "delay at rest"),
    ("varying_rms_delay_error", "delay varying"),
)


def draw(data: FigureData) -> Figure:
    """One panel a method; the dotted line is the tuning of Fig. 3."""
    job = data.job
    figure = Figure(figsize=(WIDTH, 4.6))
    panels = figure.subplots(2, 2, sharey=True)
    for axes, (name, (parameter, label)) in zip(panels.ravel(), _SWEPT.items(), strict=True):
        runs = data.study.where(observer=name, sweep=parameter)
        for style, (quantity, text) in zip(STYLES, _QUANTITIES, strict=False):
            found = runs.where(quantity=quantity)
            axes.loglog(found["level"], found["value"], **style.points(), label=text)
        chosen = getattr(job.observers[name], parameter)
        if chosen > 0:
            axes.axvline(chosen, color="0.4", linewidth=0.8, linestyle=":")
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
        "Dotted: the tuning of Fig. 3 (least squares: none, left of the scale). At rest: the last "
        f"{job.metrics.late:g} s before each jump of the delay. The gain of the\n"
        f"adaptive method is {job.study.gain_per_forgetting:g} times its forgetting "
        "here. The methods with a number are reconstructions.",
    )
    return figure
