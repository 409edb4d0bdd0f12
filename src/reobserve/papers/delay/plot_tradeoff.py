"""Error of the delay against rho: lag, Taylor remainder and noise."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from reobserve.drawing.figures import STYLES, add_note, few_ticks, new_figure
from reobserve.ledger.figure_data import FigureData

_PANELS = (
    ("rms_delay_error", "RMS error [s]", "(a) delay"),
    ("rms_angle_error", "RMS error [rad]", "(b) angle"),
)


def draw(data: FigureData) -> Figure:
    """Without noise as lines, with noise as the median of the runs and the band of nine in ten."""
    job, study = data.job, data.study
    figure, panels = new_figure((2.4, 2.2), share_time=True)
    for axes, (quantity, unit, title) in zip(panels, _PANELS, strict=True):
        for index, name in enumerate(job.observers):
            label = job.observers[name].label.rpartition(", ")[2]
            mine = study.where(observer=name, quantity=quantity)
            clean, noisy = (
                mine.where(sweep=sweep).by_level("level") for sweep in ("rho", "noise_rho")
            )
            rhos = list(clean)
            axes.loglog(
                rhos, [value for (value,) in clean.values()], **STYLES[2 * index].points(),
                label=f"{label}, no noise",
            )  # fmt: skip
            low, middle, high = np.percentile(list(noisy.values()), (5, 50, 95), axis=1)
            style = STYLES[2 * index + 1]
            axes.loglog(rhos, middle, **style.points(), label=f"{label}, noise")
            axes.fill_between(rhos, low, high, color=style.color, alpha=0.2, linewidth=0)
        few_ticks(axes, rhos)
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_ylabel(unit)
        axes.set_title(title)
    panels[0].legend(loc="upper center", ncols=2)
    low_, high_ = panels[0].get_ylim()
    panels[0].set_ylim(low_, 4 * high_)
    panels[-1].set_xlabel("gain parameter ρ [1/s]")
    scenario = job.scenario
    add_note(
        figure,
        f"u = sin 0.2 t, exact derivatives, {job.study.runs:g} runs with noise of "
        f"{scenario.output_noise:g} rad and {scenario.input_noise:g} N m; bands hold nine "
        "in ten. Counted where the delay varies,\n"
        f"{job.study.away:g} s from where the input does not change.",
    )
    return figure
