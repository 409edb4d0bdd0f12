"""Stage plant: the autonomous system from a stated initial state."""

from __future__ import annotations

import numpy as np

from reobserve.core.errors import located
from reobserve.core.matrices import as_vector
from reobserve.polynomials.maps import PolynomialMap
from reobserve.systems.polynomial import PolynomialSystem
from reobserve_papers.papers.lie import keys
from reobserve_papers.plants.polynomial import PolynomialPlant
from reobserve_papers.signals.grid import plant_grid
from reobserve_papers.signals.series import Channel, Series

MOST_STEPS = 20_000_000  # of a plant record: a gigabyte


def build_system(plant: keys.Plant, *, exact: bool = False) -> PolynomialSystem:
    """The plant's system, whose size is that of the first list of powers."""
    with located("plant"):
        states, outputs = plant.states, plant.outputs
        return PolynomialSystem(
            PolynomialMap.from_terms("dynamics", plant.dynamics, states, states, exact=exact),
            PolynomialMap.from_terms("output", plant.output, outputs, states, exact=exact),
        )


def build(job: keys.Job) -> PolynomialPlant:
    """The plant, its grid and its initial state checked, or `InputError` if they cannot be used."""
    plant_grid(job.plant.horizon, job.plant.step, MOST_STEPS)
    plant = PolynomialPlant(build_system(job.plant))
    with located("scenario"):
        as_vector("initial_state", job.scenario.initial_state, plant.system.states)
    return plant


def simulate(job: keys.Job) -> Series:
    """Channels ``state``, x, and ``output``, y = h(x), over the horizon."""
    plant = build(job)
    steps, step = plant_grid(job.plant.horizon, job.plant.step, MOST_STEPS)
    states = plant.simulate(job.scenario.initial_state, step, steps)
    time = np.arange(steps + 1, dtype=np.float64) * step
    channels = {"state": Channel(states, "1"), "output": Channel(plant.output(states), "1")}
    return Series(time, channels)
