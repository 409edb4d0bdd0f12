"""Stage observe: a bank of filters on a plant's record."""

from __future__ import annotations

import numpy as np

from reobserve.core.errors import DivergenceError
from reobserve.observers.imm import IMM
from reobserve_papers.papers.imm import keys
from reobserve_papers.papers.imm.keys import MODES
from reobserve_papers.papers.imm.setup import (
    bank,
    chattering_correction,
    measured_columns,
    run,
    saturation,
)
from reobserve_papers.papers.imm.units import UNITS
from reobserve_papers.plants.hydraulic_actuator import REALISATIONS
from reobserve_papers.signals.series import Channel, Series


def build(job: keys.Job, period: float) -> IMM:
    """The bank of an observer's settings, for a sampling period [s]."""
    return bank(job.plant, job.observer, period)


def estimate(job: keys.Job, plant: Series) -> Series:
    """Probabilities of the modes and the estimate of the velocity, from t = 0 on.

    ``probability`` has one component per mode, in the order of `MODES`. For an SVSF ``saturated``
    is the share of the innovations outside the boundary layer, and ``chattering`` the share that is
    outside and has changed its sign since the sample before. ``chattering_correction`` is how far
    the latter move the estimate of the velocity.
    """
    observer = job.observer
    chosen = build(job, plant.step)
    columns = measured_columns(observer)
    outputs = run(chosen, observer, plant["measured"][1:, columns], plant["input"][:-1])
    if outputs.diverged_at is not None:
        raise DivergenceError(observer.algorithm, outputs.diverged_at)
    start = np.full((1, len(MODES)), 1.0 / len(MODES))
    channels = {"probability": Channel(np.vstack([start, outputs["probability"]]), "1")}
    # The velocity has no feedthrough, and the same row of C in all modes.
    row = chosen.filters[0].model.C[REALISATIONS[observer.realisation].index("velocity")]
    velocity = np.concatenate([[0.0], outputs["state"] @ row])
    channels["velocity"] = Channel(velocity, UNITS["velocity"])
    if observer.algorithm == "smooth_variable_structure":
        innovation = outputs["innovation"]
        saturated, chattering = saturation(observer, innovation)
        for name, rows_of in (("saturated", saturated), ("chattering", chattering)):
            share = np.mean(rows_of, axis=(1, 2))
            channels[name] = Channel(np.concatenate([[0.0], share]), "1")
        jumps = chattering_correction(observer, innovation, chattering, outputs["probability"])
        channels["chattering_correction"] = Channel(
            np.concatenate([[0.0], jumps]), UNITS["velocity"]
        )
    return Series(plant.time, channels, plant.events)
