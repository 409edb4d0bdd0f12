"""Stage plot: fault, estimate and error over time, and errors over gains and noise."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reobserve_papers.metrics.study_table import StudyTable
from reobserve_papers.papers.ilo import keys
from reobserve_papers.papers.ilo.body import on_axis
from reobserve_papers.papers.ilo.scoring import Errors
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.parameters.job import named
from reobserve_papers.plotting.figures import (
    STYLES,
    TRUTH,
    Style,
    add_note,
    decades,
    envelope,
    headroom,
    new_figure,
    thin,
    time_axis,
)
from reobserve_papers.plotting.style_sheet import points, thick

# Each observer has the same line in all figures; user-defined observers take these in turn.
_LINES = dict(
    zip(("sampled", "continuous", "forgetting", "adaptive", "matched"), STYLES, strict=True)
)
_LEAST = 1e-6  # [N m] smaller errors are left out


def _styles(names: Iterable[str]) -> dict[str, Style]:
    return {name: _LINES.get(name, STYLES[k % len(STYLES)]) for k, name in enumerate(names)}


def estimation(data: FigureData[keys.Job]) -> Figure:
    """Plot the fault, what the first two observers (one if adaptive) estimate, and all errors."""
    job, plant, estimates = data.job, data.plant, data.estimates
    axis = job.metrics.axis
    labels = {name: job.observers[name].label for name in estimates}
    styles, first = _styles(estimates), next(iter(estimates))
    adaptive = isinstance(job.observers[first], keys.Adaptive)
    shown = list(estimates)[: 1 if adaptive else 2]
    figure, (above, middle, below) = new_figure((1.9, 1.35, 1.75))

    lines = [(f"fault of thruster {axis}", plant, TRUTH)]
    lines += [(f"estimate: {labels[name]}", estimates[name], styles[name]) for name in shown]
    for label, series, style in lines:
        points = thin(series.time, series["fault"][:, axis - 1])
        above.plot(*points, **style.line(), label=label)
    above.set_ylabel("torque [N m]")
    above.set_title("(a) fault and its estimate" + "s" * (len(shown) > 1))
    above.legend(loc="upper left", ncols=3)
    headroom(above, 0.28)

    sizes = []
    for name, estimate in estimates.items():
        errors = Errors.of(plant, estimate, axis - 1)
        if name in shown:
            middle.plot(*thin(errors.time, errors.start), **styles[name].line())
        with np.errstate(divide="ignore"):
            size = np.where(errors.start == 0, np.nan, np.abs(errors.start))
        time, largest = envelope(errors.time, size, 0.01)
        below.semilogy(time, largest, **styles[name].line(), label=labels[name])
        sizes.append(largest[time > min(plant.events["onsets"], default=0.0) - 1e-9])
    middle.set_ylabel("error e [N m]")
    whose = f": {labels[first]}" if adaptive else ""
    middle.set_title(f"(b) estimation error e = fault − estimate{whose}")
    below.set_ylabel("|e| [N m]")
    below.set_title("(c) size of the error (largest in each hundredth of a second)")
    # Whole decades of nearly all values after the onset, and one more for the legend.
    seen = np.concatenate(sizes)
    least, most = np.nanquantile(seen[seen > _LEAST], 0.02), np.nanmax(seen)
    below.set_ylim(10.0 ** np.floor(np.log10(least)), 10.0 ** np.ceil(np.log10(most)))
    headroom(below, factor=10)
    decades(below.yaxis)
    time_axis(below, plant.time)
    below.legend(loc="upper center", ncols=3)
    add_note(figure, *_note(job))
    return figure


def matching(data: FigureData[keys.Job]) -> Figure:
    """Plot errors over the integral gain and over noise, and their growth over time under noise."""
    job, study = data.job, data.study
    names = job.study.observers
    labels = {name: job.observers[name].label for name in names}
    styles = _styles(names)
    figure, (gains, noise, growth) = new_figure((2.1, 2.1, 1.7), share_time=False)

    families = (
        ("integral", "adaptive", "integral"),
        ("proportional_integral", "matched", "proportional-integral, Kₚ = Γτ/2"),
        ("ilo", "continuous", "ILO, continuous, K₂ = Γτ"),
    )
    for family, like, label in families:
        _sweep(gains, study, "integral_gain", family, styles[like], label)
    gains.set_xlabel("integral gain Γ [N m/rad]")
    gains.set_ylabel("relative RMS error [%]")
    gains.set_title("(a) error for the fault of Figs 3 and 4 over the integral gain")
    for name, place, side in (("adaptive", "Fig. 4", 3), ("matched", "matched", -3)):
        observer = named(job.observers, name, keys.Adaptive)
        gain = on_axis(observer.integral_gain, job.metrics.axis - 1)
        gains.axvline(gain, ymax=0.8, color="0.5", linewidth=thick(0.8), linestyle=":")
        gains.annotate(
            place, (gain, 0.06), xycoords=("data", "axes fraction"), xytext=(side, 0),
            textcoords="offset points", ha="left" if side > 0 else "right", fontsize=points(7),
            color="0.3",
        )  # fmt: skip
    gains.legend(loc="upper center", ncols=3)
    headroom(gains, factor=20)

    for name in names:
        _sweep(noise, study, "noise", name, styles[name], labels[name])
    noise.set_xlabel("standard deviation of the rate measurement [rad/s]")
    noise.set_ylabel("relative RMS error [%]")
    noise.set_title("(b) the same error over the measurement noise")
    noise.legend(loc="upper left", ncols=2)
    headroom(noise, factor=30)

    for name in names:
        if name != "adaptive":  # its error is that without noise
            _sweep(growth, study, "time", name, styles[name], labels[name])
    growth.set_xscale("linear")
    growth.xaxis.set_major_formatter("{x:g}")
    growth.set_xlabel("end of the second over which the error is taken [s]")
    growth.set_ylabel("relative RMS error [%]")
    growth.set_title(f"(c) error over time, noise of {job.study.shown_noise:g} rad/s")
    growth.legend(loc="upper left", ncols=2)
    headroom(growth, factor=30)
    add_note(figure, *_note(job))
    return figure


def _sweep(axes: Axes, study: StudyTable, sweep: str, name: str, style: Style, label: str) -> None:
    """Plot the mean over runs against the level, with the range of the runs."""
    runs = study.where(sweep=sweep, observer=name).by_level("level", "relative_rms_error")
    scores = [100 * errors for errors in runs.values()]
    axes.loglog(list(runs), [np.mean(errors) for errors in scores], **style.points(), label=label)
    decades(axes.xaxis)
    decades(axes.yaxis)
    least, most = ([end(errors) for errors in scores] for end in (np.min, np.max))
    axes.fill_between(list(runs), least, most, color=style.color, alpha=0.2, linewidth=0)


def _note(job: keys.Job) -> list[str]:
    """Settings of each observer, one paragraph per observer."""
    lines = ["Settings (the paper names only K₁ = I; units: N m, s, rad):"]
    symbols = {
        "K1": "K₁",
        "K2": "K₂",
        "observer_gain": "Λ",
        "update_interval": "τ",
        "integral_gain": "Γ",
        "proportional_gain": "Kₚ",
    }
    for observer in job.observers.values():
        values = ", ".join(
            f"{symbol} = {_short(getattr(observer, key))}"
            for key, symbol in symbols.items()
            if hasattr(observer, key)
        )
        lines.append(f"{observer.label}: {values}")
    return lines


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, int | float) else "matrix, see the parameter file"


LAYOUTS = {"estimation": estimation, "matching": matching}
