"""Stage plant: the actuator under its input, with the fault, and what is measured of it."""

from __future__ import annotations

import numpy as np

from reobserve_papers.papers.imm import keys
from reobserve_papers.papers.imm.setup import ActuatorExperiment, experiment
from reobserve_papers.papers.imm.units import UNITS
from reobserve_papers.plants.hydraulic_actuator import MOTION
from reobserve_papers.plants.hydraulic_actuator import simulate as move
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Channel, Series


def build(job: keys.Job) -> ActuatorExperiment:
    """The scenario, checked (see `experiment`)."""
    return experiment(job.plant, job.scenario)


def simulate(job: keys.Job) -> Series:
    """The motion, and what is measured of it, over the horizon.

    ``motion`` has the components of `MOTION`, ``measured`` the same with noise. ``input`` is held
    from each sample on. ``mode`` is 0 or 1, and the event ``fault`` is the time of its change.
    """
    setup = build(job)
    motion = move(setup.models, setup.mode, setup.control, setup.period, setup.switching_condition)
    stream = random_stream(job.seed, "imm", "noise")
    measured = motion + setup.noise * stream.standard_normal(motion.shape)
    time = np.arange(len(motion), dtype=np.float64) * setup.period
    units = ", ".join(UNITS[name] for name in MOTION)
    last = len(setup.control) - 1
    held = np.minimum(np.arange(len(motion)), last)
    return Series(
        time,
        {
            "motion": Channel(motion, units),
            "measured": Channel(measured, units),
            "input": Channel(setup.control[held], job.scenario.input_unit),
            "mode": Channel(setup.mode[held].astype(np.float64), "1"),
        },
        {"fault": (setup.onset,)},
    )
