"""Correct diagnoses against the nu-gap between the models, by bank and noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reobserve.drawing.figures import STYLES, add_note, new_figure
from reobserve.ledger.types import Job
from reobserve.papers.imm.metrics import diagnoses
from reobserve.scoring.metrics import Metric
from reobserve.timeseries.series import Series

Array = NDArray[np.float64]

NORMAL_QUANTILE = 1.959963984540054  # of 0.975


def draw(
    job: Job,
    _: Series,
    __: Mapping[str, Series],
    study: Sequence[Mapping[str, Any]],
    ___: Sequence[Metric],
) -> Figure:
    """One panel a level of noise; bands are Wilson's intervals of 95 %."""
    found = diagnoses(study)
    levels = list(dict.fromkeys(noise for _, noise in found))
    figure, panels = new_figure((1.75,) * len(levels), share_time=True)
    wanted = job.study.enough
    labels = {name: body.label for name, body in job.observers.items()}
    names = list(dict.fromkeys(name for name, _ in found if name != "models"))
    for axes, noise, letter in zip(panels, levels, "abcdefgh", strict=False):
        gaps = found["models", noise]
        for style, name in zip(STYLES, names, strict=False):
            shares = found[name, noise]
            x = [gaps[share][0] for share in shares]
            right = np.array([np.count_nonzero(np.array(v) > 0.5) for v in shares.values()])
            runs = np.array([len(v) for v in shares.values()])
            low, high = wilson(right, runs)
            axes.plot(
                x,
                right / runs,
                **style.points(),
                label=labels.get(name, f"{labels[names[0]]}, no mixing"),
            )
            axes.fill_between(x, low, high, color=style.color, alpha=0.18, linewidth=0)
        axes.axhline(wanted, color="0.4", linewidth=0.8, linestyle=":")
        axes.set_xscale("log")
        axes.set_ylim(-0.04, 1.04)
        axes.set_ylabel("correct share")
        size = float(noise.removeprefix("noise_"))
        axes.set_title(f"({letter}) noise of {size:.0%} of each output")
    panels[0].legend(loc="lower right")
    panels[-1].set_xlabel("ν-gap between the normal and the faulty model")
    panels[-1].xaxis.set_major_formatter("{x:g}")
    panels[-1].set_xticks((0.001, 0.003, 0.01, 0.03, 0.1, 0.3))
    panels[-1].xaxis.set_minor_formatter("")
    study_settings = job.study
    add_note(
        figure,
        f"Pseudo-random input, {study_settings.runs:g} runs a point, bands of 95 % (Wilson). "
        "Banks of two models: normal, and its blend with the leakage model\nthat the plant changes "
        f"to. Correct: over the last {study_settings.judged:g} s the faulty model is the more "
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
