"""Figs 5 to 8 of the paper: the probability of a mode, and beside it friction and the input."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from reobserve.drawing.figures import STYLES, add_note, headroom, new_figure, thin, time_axis
from reobserve.ledger.figure_data import FigureData
from reobserve.ledger.types import Job
from reobserve.papers.imm.setup import MODES

Array = NDArray[np.float64]


def draw(data: FigureData) -> Figure:
    """The mode's probability with the values that the paper quotes, friction, and the velocity."""
    job, plant, estimates = data.job, data.plant, data.estimates
    figure, (wanted, friction, motion) = new_figure((2.5, 1.2, 1.2))
    layout = job.figure.layout
    for axes, mode, letter in zip((wanted, friction), (layout, "friction"), "ab", strict=True):
        index = MODES.index(mode)
        for style, (name, estimate) in zip(STYLES, estimates.items(), strict=False):
            time, low, mean, high = binned(estimate.time, estimate["probability"][:, index])
            axes.fill_between(time, low, high, color=style.color, alpha=0.15, linewidth=0)
            axes.plot(time, mean, **style.line(), label=job.observers[name].label)
        axes.set_ylim(-0.04, 1.08)
        axes.set_ylabel("probability")
        axes.set_title(f"({letter}) {mode} mode")
    start, end = job.metrics.after
    place = ("normal", "leakage").index(layout)
    for style, name in zip(STYLES, estimates, strict=False):
        quoted = job.observers[name].quoted[place]
        wanted.plot(
            (start, end), (quoted, quoted), color=style.color, linestyle=":", linewidth=2.2,
            label=f"quoted by the paper: {quoted:g}",
        )  # fmt: skip
    wanted.legend(loc="center left", ncols=1)
    motion.plot(
        *thin(plant.time, plant["input"], 600), color="0.8", linewidth=0.6, label="input [V]"
    )
    motion.plot(*thin(plant.time, plant["motion"][:, 1], 600), **STYLES[0].line(),
                label="velocity [y]")  # fmt: skip
    motion.set_ylabel("velocity, input")
    motion.set_title("(c) the plant")
    motion.legend(loc="upper left", ncols=2)
    headroom(motion, 0.45)
    onset = next(iter(estimates.values())).events["fault"][0]
    for axes in (wanted, friction, motion):
        axes.axvline(onset, color="0.4", linewidth=0.8, linestyle=":")
    time_axis(motion, plant.time)
    add_note(figure, _note(job))
    return figure


def binned(time: Array, values: Array, width: float = 0.03) -> tuple[Array, Array, Array, Array]:
    """Time, and least, mean and greatest value of each bin of ``width`` seconds.

    A probability that flips from sample to sample shows as a band with its mean in it.
    """
    size = max(1, round(width / (time[1] - time[0])))
    count = len(time) // size
    block = values[: count * size].reshape(count, size)
    middle = time[: count * size].reshape(count, size).mean(axis=1)
    return middle, block.min(axis=1), block.mean(axis=1), block.max(axis=1)


def _note(job: Job) -> str:
    scenario, first = job.scenario, next(iter(job.observers.values()))
    noise = "no noise" if not any(scenario.noise) else "noise of one per cent of each output"
    kind = scenario.input[0]["kind"]
    stimulus = {"constant": "a step", "prbs": "a pseudo-random binary sequence"}.get(kind, kind)
    return (
        "Vertical line: the leak begins. Curves are means over 30 ms, bands reach from the least "
        f"to the greatest\nvalue. Chosen here: {stimulus} of 1.5 V from 0.5 s on, samples every "
        f"{1000 * scenario.period:g} ms,\n{noise}, position, velocity and acceleration as "
        "outputs, covariances of the noise as in\nthe ledger, modes that stay with a probability "
        f"of {first.stay:g} a sample."
    )
