"""Stage plant: the actuator under its input, with the fault, and what is measured of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, located
from reobserve_papers.papers.imm import keys
from reobserve_papers.papers.imm.keys import MODES
from reobserve_papers.papers.imm.units import UNITS
from reobserve_papers.plants.hydraulic_actuator import MOTION, ActuatorModel
from reobserve_papers.plants.hydraulic_actuator import simulate as move
from reobserve_papers.signals.grid import multiple
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Channel, Series

Array = NDArray[np.float64]

MOST_STEPS = 5_000_000  # of a plant's record


def modes(plant: keys.Plant) -> list[ActuatorModel]:
    """The identified models, in the order of `MODES`, or `InputError` with the wrong one."""
    found = []
    for name in MODES:
        try:
            numerator, denominator = (
                getattr(plant, f"{name}_{part}") for part in ("numerator", "denominator")
            )
            found.append(ActuatorModel(numerator, denominator))
        except InputError as error:
            raise InputError(f"plant.{name}_{error.parameter}", error.problem) from None
    return found


@dataclass(frozen=True)
class ActuatorExperiment:
    """A checked scenario: input and mode of each step, and standard deviations of the noise.

    ``models`` are two, before and after the fault; ``mode`` is the index of one, shape (k,), and
    ``control``, (k,), the input; ``noise``, (4,), of `MOTION`; ``onset`` [s];
    ``switching_condition`` as `reobserve_papers.plants.hydraulic_actuator.simulate` has it.
    """

    models: tuple[ActuatorModel, ActuatorModel]
    mode: NDArray[np.int64]
    control: Array
    noise: Array
    period: float
    onset: float
    switching_condition: str


def build(job: keys.Job) -> ActuatorExperiment:
    """The input, modes and noise of a scenario."""
    plant, scenario = job.plant, job.scenario
    known = modes(plant)
    horizon, period, onset = plant.horizon, scenario.period, scenario.onset
    with located("scenario"):
        if horizon > MOST_STEPS * period:
            raise InputError("period", f"{period:g} s makes more than {MOST_STEPS:g} steps")
        steps = multiple("period", horizon, period, "the period")
        control = Signal.parse("input", scenario.input, 1)
        control.check_grid("input", period, horizon)
        if onset >= horizon:
            raise InputError("onset", f"{onset:g} s must be before the end at {horizon:g} s")
        begin = multiple("onset", onset, period, "the period")
        noise = np.array(scenario.noise, dtype=np.float64)
        faulty = known[0].blended(known[MODES.index(scenario.fault)], scenario.share)
    rows = np.arange(steps, dtype=np.float64)
    return ActuatorExperiment(
        (known[0], faulty),
        (rows >= begin).astype(np.int64),
        control(rows * period)[:, 0],
        noise,
        period,
        onset,
        scenario.switching_condition,
    )


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
