"""Errors against rho: lag, Taylor remainder and noise, and the ratio of the two orders."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reobserve.core.arguments import as_kind
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.notes import noise
from reobserve_papers.papers.delay.styles import style_of
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.plotting.figures import add_note, few_ticks, headroom, new_figure
from reobserve_papers.plotting.style_sheet import points, thick

_PANELS = (
    ("varying_rms_delay_error", "RMS error [s]", "(a) delay"),
    ("varying_rms_error_1", "RMS error [rad]", "(b) angle"),
)
_KINDS = (("rho", "no noise", "none"), ("noise_rho", "noise", None))  # and how markers are filled


def draw(data: FigureData[keys.Job]) -> Figure:
    """Plot errors without noise, and with noise the mean and the range of the runs."""
    job, study = data.job, data.study
    runs_with_noise = as_kind("study", job.study, keys.Tradeoff).runs
    figure, panels = new_figure((2.2, 2.0, 1.7), share_time=True)
    for axes, (quantity, unit, title) in zip(panels[:2], _PANELS, strict=True):
        for name, observer in job.observers.items():
            label, style = _m(data, name), style_of(observer)
            mine = study.where(observer=name, quantity=quantity)
            for sweep, kind, face in _KINDS:
                filled = {"markerfacecolor": face or style.color, "label": f"{label}, {kind}"}
                runs = mine.where(sweep=sweep).by_level("level")
                if not runs:  # of the delay by the standard observer
                    axes.loglog([], [], **style.points(), **filled)
                    continue
                rhos = list(runs)
                each = np.array(list(runs.values()))
                low, middle, high = each.min(axis=1), each.mean(axis=1), each.max(axis=1)
                axes.loglog(rhos, middle, **style.points(), **filled)
                if face is None:
                    axes.fill_between(rhos, low, high, color=style.color, alpha=0.2, linewidth=0)
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_ylabel(unit)
        axes.set_title(title)
    _compare(panels[2], data)
    few_ticks(panels[2], rhos)
    panels[0].legend(loc="upper center", ncols=3)
    headroom(panels[0], factor=5)
    panels[-1].set_xlabel("gain parameter ρ [1/s]")
    add_note(
        figure,
        f"{noise(job)}.\n"
        f"{runs_with_noise:g} runs with noise: means, and bands from minimum to maximum. Errors "
        f"where the delay varies, from {job.metrics.varying_from:g} to "
        f"{job.metrics.varying_until:g} s.",
    )
    return figure


def _compare(axes: Axes, data: FigureData[keys.Job]) -> None:
    """Plot the error of each order over that of the last one, and mark rho of the figure."""
    observers = {k: v for k, v in data.job.observers.items() if isinstance(v, keys.Extended)}
    *others, last = observers
    for name in others:
        style = style_of(observers[name])
        for sweep, kind, face in _KINDS:
            above, below = (
                data.study.where(
                    observer=who, quantity="varying_rms_delay_error", sweep=sweep
                ).by_level("level")
                for who in (name, last)
            )
            ratios = [float(np.mean(above[rho]) / np.mean(below[rho])) for rho in above]
            filled = {"markerfacecolor": face or style.color}
            axes.loglog(
                list(above), ratios, **style.points(), **filled, label=f"{_m(data, name)}, {kind}"
            )
    axes.axhline(1.0, color="0.4", linewidth=thick(0.8))
    for rho in dict.fromkeys(body.rho for body in observers.values()):
        axes.axvline(rho, color="0.4", linewidth=thick(0.8), linestyle="-.")
        axes.annotate(
            "ρ of Fig. 2",
            (rho, 0.08),
            (3, 0),
            fontsize=points(7),
            color="0.3",
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
        )
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter("")
    axes.set_yticks([0.1, 0.2, 0.5, 1.0])
    axes.set_ylabel("ratio")
    axes.set_title(f"(c) error of the delay over that for {_m(data, last)}")
    axes.legend(loc="lower left")


def _m(data: FigureData[keys.Job], name: str) -> str:
    """The short name of an observer: m = 1, m = 2 or standard."""
    label = str(data.job.observers[name].label)
    return label.rpartition(", ")[2] if ", " in label else label.split(maxsplit=1)[0]
