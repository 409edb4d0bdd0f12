"""Stage plant: the autonomous system from a stated initial state."""

from __future__ import annotations

from typing import Any

import numpy as np

from reobserve.errors import located
from reobserve.matrices import as_vector
from reobserve.papers.lie.setup import build_system, grid
from reobserve.plants.polynomial import PolynomialPlant
from reobserve.series import Channel, Series


def build(settings: dict[str, Any]) -> PolynomialPlant:
    """The plant, its grid and its initial state checked; `InputError` if they cannot be used."""
    grid(settings["plant"])
    plant = PolynomialPlant(build_system(settings["plant"]))
    with located("scenario"):
        as_vector("initial_state", settings["scenario"]["initial_state"], plant.system.states)
    return plant


def simulate(settings: dict[str, Any]) -> Series:
    """Channels ``state``, x, and ``output``, y = h(x), over the horizon.

    Raises
    ------
    InputError
        If a parameter cannot be used.
    DivergenceError
        If the state leaves the range of floating-point numbers.
    """
    plant = build(settings)
    steps, step = grid(settings["plant"])
    states = plant.simulate(settings["scenario"]["initial_state"], step, steps)
    time = np.arange(steps + 1, dtype=np.float64) * step
    channels = {"state": Channel(states, "1"), "output": Channel(plant.output(states), "1")}
    return Series(time, channels)
