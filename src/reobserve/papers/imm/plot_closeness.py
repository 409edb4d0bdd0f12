"""Correct diagnoses against the nu-gap between the models, by bank and noise."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reobserve.drawing.figures import STYLES, add_note, few_ticks, new_figure
from reobserve.ledger.figure_data import FigureData
from reobserve.papers.imm.metrics import diagnoses, noise_of

Array = NDArray[np.float64]

NORMAL_QUANTILE = 1.959963984540054  # of 0.975


def draw(data: FigureData) -> Figure:
    """One panel a level of noise; bands are Wilson's intervals of 95 %."""
    job, study = data.job, data.study
    sweeps = study.levels("sweep")
    figure, panels = new_figure((1.75,) * len(sweeps), share_time=True)
    wanted = job.study.enough
    labels = {name: body.label for name, body in job.observers.items()}
    names = study.where(quantity="probability").levels("observer")
    for axes, sweep, letter in zip(panels, sweeps, "abcdefgh", strict=False):
        for style, name in zip(STYLES, names, strict=False):
            gaps, right, runs = diagnoses(study, name, sweep)
            label = labels.get(name, f"{labels[names[0]]}, no mixing")
            axes.plot(gaps, right / runs, **style.points(), label=label)
            axes.fill_between(
                gaps, *wilson(right, runs), color=style.color, alpha=0.18, linewidth=0
            )
        axes.axhline(wanted, color="0.4", linewidth=0.8, linestyle=":")
        axes.set_xscale("log")
        axes.set_ylim(-0.04, 1.04)
        axes.set_ylabel("correct share")
        axes.set_title(f"({letter}) noise of {noise_of(sweep):.0%} of each output")
    panels[0].legend(loc="lower right")
    panels[-1].set_xlabel("ν-gap between the normal and the faulty model")
    few_ticks(panels[-1], (0.001, 0.003, 0.01, 0.03, 0.1, 0.3))
    add_note(
        figure,
        f"Pseudo-random input, {job.study.runs:g} runs a point, bands of 95 % (Wilson). "
        "Banks of two models: normal, and its blend with the leakage model\nthat the plant changes "
        f"to. Correct: over the last {job.study.judged:g} s the faulty model is the more "
        f"probable. Dotted: {wanted:.0%}.",
    )
    return figure


def wilson(right: Array, runs: Array) -> tuple[Array, Array]:
    """The interval of 95 % for a probability, from counts (Wilson 1927)."""
    z2 = NORMAL_QUANTILE**2
    share = right / runs
    middle = (share + z2 / (2 * runs)) / (1 + z2 / runs)
    width = NORMAL_QUANTILE * np.sqrt(share * (1 - share) / runs + z2 / (4 * runs**2))
    width = width / (1 + z2 / runs)
    return middle - width, middle + width
