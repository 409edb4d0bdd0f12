"""The ranking of Fig. 3 over the tuning of each method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from reobserve.drawing.figures import STYLES, WIDTH, add_note, decades
from reobserve.ledger.types import Job
from reobserve.papers.delay.plot_tradeoff import levels
from reobserve.scoring.metrics import Metric
from reobserve.timeseries.series import Series

_AXES = {
    "extended_lag": "ρ [1/s]",
    "least_squares": "forgetting [1/s]",
    "adaptive": "forgetting [1/s]",
    "relay": "gain M [1/s²]",
}
_QUANTITIES = (
    ("resting_rms_delay_error", "delay at rest"),
    ("varying_rms_delay_error", "delay varying"),
)


def draw(
    job: Job,
    _: Series,
    __: Mapping[str, Series],
    study: Sequence[Mapping[str, Any]],
    ___: Sequence[Metric],
) -> Figure:
    """One panel a method; the dotted line is the tuning of Fig. 3."""
    figure = Figure(figsize=(WIDTH, 4.6))
    panels = figure.subplots(2, 2, sharey=True)
    parameters = {
        "extended_lag": "rho",
        "least_squares": "forgetting",
        "adaptive": "forgetting",
        "relay": "relay_gain",
    }
    for axes, (name, label) in zip(panels.ravel(), _AXES.items(), strict=True):
        for style, (quantity, text) in zip(STYLES, _QUANTITIES, strict=False):
            found = levels(study, name, parameters[name], quantity)
            axes.loglog(
                list(found), [value[0] for value in found.values()], **style.points(), label=text
            )
        chosen = getattr(job.observers[name], parameters[name])
        if chosen > 0:
            axes.axvline(chosen, color="0.4", linewidth=0.8, linestyle=":")
        axes.set_title(job.observers[name].label.replace(", a reconstruction of", ""))
        axes.set_xlabel(label)
        axes.set_xticks(list(found))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter("")
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
