"""Figures of the studies: margins of the tuned numbers, changes of one setting, and causes."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reobserve.core.arguments import as_kind
from reobserve_papers.papers.imm import keys
from reobserve_papers.papers.imm.notes import KALMAN as KALMAN_STYLE
from reobserve_papers.papers.imm.notes import SVSF, stimulus, style_of
from reobserve_papers.papers.imm.study_rows import FROZEN, INTACT, KALMAN, SCANNED, TUNED, ZERO_RATE
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.parameters.job import named
from reobserve_papers.plotting.figures import (
    STYLES,
    add_note,
    blank,
    few_ticks,
    headroom,
    new_figure,
)
from reobserve_papers.plotting.style_sheet import mark, thick

Array = NDArray[np.float64]

_NUMBERS = {
    "process_noise_1": "Q, position",
    "process_noise_2": "Q, velocity",
    "process_noise_3": "Q, x₂",
    "process_noise_4": "Q, x₃",
    "process_noise_5": "Q, x₄",
    "measurement_noise_1": "R, position",
    "measurement_noise_2": "R, velocity",
    "measurement_noise_3": "R, acceleration",
    "leave": "probability to leave",
}


def draw_neighbourhood(data: FigureData[keys.Job]) -> Figure:
    """Bars of the margins, and mean probabilities over the number with the smallest margin."""
    figure, (bars, curves) = new_figure((2.5, 2.3), share_time=True)
    job, numbers = data.job, data.metrics
    settings = as_kind("study", job.study, keys.Neighbourhood)
    most = max(settings.factors)
    for row, parameter in enumerate(TUNED):
        low = numbers[parameter, "minimum_factor"]
        high = numbers[parameter, "maximum_factor"]
        bars.plot((low, high), (row, row), color="0.35", linewidth=thick(5), solid_capstyle="butt")
        for end, side in ((low, -1), (high, 1)):
            open_end = abs(end - most ** float(side)) < 1e-9
            bars.plot(end, row, marker=("<" if side < 0 else ">") if open_end else "|",
                      color="0.1", markersize=mark(7))  # fmt: skip
    bars.axvline(1.0, color="0.4", linewidth=thick(0.8), linestyle=":")
    bars.set_yticks(range(len(TUNED)), [_NUMBERS[name] for name in TUNED])
    bars.invert_yaxis()
    bars.set_xscale("log")
    bars.set_title(f"(a) factors that keep every quoted value within ±{settings.band:g}")
    narrow = min(
        TUNED,
        key=lambda name: numbers[name, "maximum_factor"] / numbers[name, "minimum_factor"],
    )
    for name, body in job.observers.items():
        style = style_of(body)
        for quantity, width in (("normal_after", 1.2), ("leakage_after", 2.4)):
            mine = data.study.where(observer=name, quantity=quantity)
            rows = [mine.where(sweep=sweep) for sweep in (narrow, "stated")]
            level, value = (
                np.concatenate([table[part] for table in rows]) for part in ("level", "value")
            )
            order = np.argsort(level)
            curves.plot(
                level[order], value[order], color=style.color, linestyle=style.linestyle,
                linewidth=thick(width),
                label=f"{body.label}, {quantity.removesuffix('_after')}",
            )  # fmt: skip
    curves.set_ylim(-0.03, 1.03)
    headroom(curves, to=1.5)
    curves.set_yticks((0, 0.5, 1))
    curves.set_ylabel("mean probability")
    curves.set_title(f"(b) the number with the smallest margin: {_NUMBERS[narrow]}")
    curves.legend(loc="upper left", ncols=2)
    curves.set_xlabel("factor to the tuned number")
    few_ticks(curves, (0.1, 0.2, 0.5, 1, 2, 5, 10))
    curves.set_xlim(0.93 / most, most / 0.93)
    add_note(
        figure,
        f"{numbers['search', 'tuned']:g} numbers tuned to {numbers['search', 'targets']:g} "
        f"targets by {numbers['search', 'trials']:g} trials of three banks; "
        f"{numbers['search', 'distance']:.3f} is left (root mean square over time).\n"
        "Arrows: beyond the range of the study. States x₂ to x₄ of the scaled realisation.",
    )
    return figure


_CHANGES = {
    "as_stated": "as calibrated",
    "unmixed": "no mixing",
    "prbs": "pseudo-random input",
    "square": "square wave, 1 s",
    "sweep": "sine sweep, 1 to 45 Hz",
    "friction": "friction instead of leak",
    "states": "states go on through the leak",
    "outputs": "outputs switched at the leak",
    "certain": "normal mode certain at t = 0",
    "weighted": "H⁺ weighted by covariance",
    "start": "P(0) = {level:g} y²",
    "period": "samples every {ms:g} ms",
    "share": "{share:.0%} of the leak",
    "layer": "boundary layers × {level:g}",
    "noise": "noise of one per cent",
}


def draw_changes(data: FigureData[keys.Job]) -> Figure:
    """Mean probabilities of all modes, one row per change."""
    study, observers = data.study, data.job.observers
    changes = [change for change, _ in study.groups("sweep", "level")]
    figure = blank(0.9 + 0.24 * len(changes))
    panels = figure.subplots(1, 3, sharey=True)
    for axes, mode, letter in zip(panels, ("normal", "leakage", "friction"), "abc", strict=True):
        for order, (name, body) in enumerate(observers.items()):
            style = style_of(body)
            mine = study.where(observer=name, quantity=f"{mode}_after")
            shown = [change for change, _ in mine.groups("sweep", "level")]
            axes.plot(
                mine["value"], [changes.index(change) + 0.2 * (order - 1) for change in shown],
                linestyle="", marker=style.marker, color=style.color, markersize=mark(4.5),
                label=body.label,
            )  # fmt: skip
            if mode != "friction":  # the paper quotes none for it
                quoted = body.quoted[("normal", "leakage").index(mode)]
                axes.axvline(quoted, color=style.color, linestyle=":", linewidth=thick(1.4))
        axes.set_xlim(-0.05, 1.05)
        axes.set_title(f"({letter}) {mode} mode")
    start, end = data.job.metrics.after
    panels[1].set_xlabel(f"mean probability, {start:g} to {end:g} s")
    names = [_CHANGES[sweep].format(level=k, ms=1000 * k, share=k) for sweep, k in changes]
    panels[0].set_yticks(range(len(changes)), names)
    panels[0].invert_yaxis()
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=3)
    add_note(
        figure,
        "Dotted: the values that the paper quotes. Each row differs from the first in one thing; "
        "the noise enters the record only, not R.",
    )
    return figure


# In drawing order: variants that agree with the SVSF-IMM lie on it with smaller markers. No lines
# join the points, because the probabilities jump from scale to scale.
_CURVES = {
    INTACT: (SVSF, 6.5, "SVSF-IMM"),
    FROZEN: (STYLES[4], 4.0, "gains frozen at their means: nothing switches"),
    ZERO_RATE: (STYLES[3], 2.0, "γ = 0"),
}


def _curve(by_level: dict[float, Array]) -> tuple[list[float], list[float]]:
    return list(by_level), [float(values[0]) for values in by_level.values()]


def draw_causes(data: FigureData[keys.Job]) -> Figure:
    """Probability of the faulty mode and share of innovations outside, over the layers' unit."""
    job = data.job
    study = data.study.where(run=SCANNED)
    figure, (mode, outside) = new_figure((3.4, 1.3))
    # The KF-IMM has no layers and is the same at all scales.
    kalman = study.where(sweep=KALMAN, quantity="fault_after")["value"][0]
    mode.axhline(kalman, **KALMAN_STYLE.line(), label="KF-IMM")
    for variant, (style, size, label) in _CURVES.items():
        levels = study.where(sweep=variant, quantity="fault_after").by_level("level")
        points = {**style.points(), "linestyle": "", "markersize": mark(size)}
        mode.plot(*_curve(levels), **points, label=label)
    for quantity, marker, label in (
        ("saturation_fraction", "o", "outside"), ("chattering_fraction", "x", "with another sign"),
    ):  # fmt: skip
        levels = study.where(sweep=INTACT, quantity=quantity).by_level("level")
        outside.plot(*_curve(levels), color=SVSF.color, marker=marker, linestyle="",
                     markersize=mark(4), label=label)  # fmt: skip
    outside.legend()
    name = study["observer"][0]
    scale = named(job.observers, name, keys.SmoothVariableStructure).layer_scale
    for axes in (mode, outside):
        axes.axvline(scale, color="0.4", linewidth=thick(0.8), linestyle=":")
        axes.set_ylim(-0.04, 1.04)
    mode.set_xscale("log")
    start, end = job.metrics.after
    mode.set_ylabel(f"mean probability,\n{start:g} to {end:g} s")
    mode.set_title(f"(a) {job.scenario.fault} mode")
    outside.set_title("(b) innovations of the SVSF-IMM outside its boundary layers")
    outside.set_ylabel("share")
    outside.set_xlabel("scale of ψ [1]")
    figure.legend(*mode.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    add_note(
        figure,
        f"{stimulus(job.scenario.input, job.scenario.input_unit)}. Dotted: the scale of the "
        "parameter file. Where points are missing, the bank diverges or cannot be frozen.",
    )
    return figure
