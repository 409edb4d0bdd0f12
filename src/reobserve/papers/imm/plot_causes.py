"""The SVSF-IMM with one cause changed: the leak's probability, and how much lies outside."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reobserve.papers.imm.notes import stimulus
from reobserve.papers.imm.study_rows import HELD, INSIDE, NO_MEMORY, SCANNED
from reobserve.papers.imm.styles import KALMAN, SVSF
from reobserve.plotting.figures import STYLES, Style, add_note, new_figure
from reobserve.plotting.look import thick
from reobserve.replication.parameters.figure_data import FigureData

Array = NDArray[np.float64]

# In the order in which they are drawn: what is like the whole SVSF-IMM lies on it, thinner.
_CURVES = {
    "whole": (Style(SVSF.color, "-", 3.6), "SVSF-IMM"),
    "kalman": (KALMAN, "KF-IMM"),
    "gain": (STYLES[2], "SVSF's gain on the means, Kalman's covariances"),
    "covariance": (STYLES[3], "Kalman's gain on the means, SVSF's covariances"),
    HELD: (STYLES[4], "SVSF's gain held at its mean: nothing switches"),
    NO_MEMORY: (Style("#f2c9ae", "-", 0.9), "SVSF without memory (γ = 0)"),
    INSIDE: (Style("#b3265e", (0, (3, 1, 1, 1, 1, 1)), 1.1, "p"), "SVSF without saturation"),
}


def _curve(found: dict[float, Array]) -> tuple[list[float], list[float]]:
    return list(found), [float(values[0]) for values in found.values()]


def draw(data: FigureData) -> Figure:
    """Probability of the faulty mode and share of innovations outside, over the layers' unit."""
    job = data.job
    study = data.study.where(run=SCANNED)
    figure, (mode, outside) = new_figure((3.4, 1.3))
    for variant, (style, label) in _CURVES.items():
        found = study.where(sweep=variant, quantity="fault_after").by_level("level")
        if variant == "kalman":  # it has no layers
            mode.axhline(next(iter(found.values()))[0], **style.line(), label=label)
            continue
        mode.plot(*_curve(found), **style.points(), label=label)
    found = study.where(sweep="whole", quantity="outside_share").by_level("level")
    outside.plot(*_curve(found), **_CURVES["whole"][0].line())
    name = study["observer"][0]
    stated = job.observers[name].layer_unit
    for axes in (mode, outside):
        axes.axvline(stated, color="0.4", linewidth=thick(0.8), linestyle=":")
        axes.set_ylim(-0.04, 1.04)
    mode.set_xscale("log")
    start, end = job.metrics.after
    mode.set_ylabel(f"mean probability,\n{start:g} to {end:g} s")
    mode.set_title(f"(a) {job.scenario.fault} mode")
    outside.set_title("(b) innovations of the SVSF-IMM outside its boundary layers")
    outside.set_ylabel("share")
    outside.set_xlabel("unit of ψ [units of the outputs here]")
    figure.legend(*mode.get_legend_handles_labels(), loc="outside upper left", ncols=2)
    add_note(
        figure,
        f"{stimulus(job.scenario.input, job.scenario.input_unit)}. Dotted: the unit of the ledger. "
        "A curve ends where its bank diverges.",
    )
    return figure
