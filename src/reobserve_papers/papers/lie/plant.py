"""Stage plant: the autonomous system from a stated initial state."""

from __future__ import annotations

import numpy as np

from reobserve.core.errors import located
from reobserve.core.matrices import as_vector
from reobserve_papers.papers.lie import keys
from reobserve_papers.papers.lie.setup import build_system, grid
from reobserve_papers.plants.polynomial import PolynomialPlant
from reobserve_papers.signals.series import Channel, Series


def build(job: keys.Job) -> PolynomialPlant:
    """The plant, its grid and its initial state checked, or `InputError` if they cannot be used."""
    grid(job.plant)
    plant = PolynomialPlant(build_system(job.plant))
    with located("scenario"):
        as_vector("initial_state", job.scenario.initial_state, plant.system.states)
    return plant


def simulate(job: keys.Job) -> Series:
    """Channels ``state``, x, and ``output``, y = h(x), over the horizon."""
    plant = build(job)
    steps, step = grid(job.plant)
    states = plant.simulate(job.scenario.initial_state, step, steps)
    time = np.arange(steps + 1, dtype=np.float64) * step
    channels = {"state": Channel(states, "1"), "output": Channel(plant.output(states), "1")}
    return Series(time, channels)
