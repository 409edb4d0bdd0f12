"""Models, signals and the grid, from the parameters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, located
from reobserve.systems.triangular import TriangularModel
from reobserve_papers.papers.delay import keys
from reobserve_papers.signals.grid import multiple, plant_grid
from reobserve_papers.signals.inputs import Signal

Array = NDArray[np.float64]

MAX_STEPS = 5_000_000  # of a plant record: a gigabyte


def build_model(plant: keys.Plant, name: keys.Model) -> TriangularModel:
    """The model that a scenario names, the only one that is imported, since it compiles its own."""
    if name == "lag":
        from reobserve_papers.plants.first_order_lag import first_order_lag

        return first_order_lag()
    from reobserve_papers.plants.pendulum import pendulum

    with located("plant"):
        return pendulum(plant.gravity, plant.length, plant.mass, plant.friction)


def delay_bounds(plant: keys.Plant) -> tuple[float, float]:
    """The interval of the delay [s]."""
    low, high = plant.delay_bounds
    return float(low), float(high)


def grid(plant: keys.Plant) -> tuple[int, float]:
    """The number of plant steps and the step [s], of which the maximum delay is a multiple, too."""
    longest = delay_bounds(plant)[1]
    steps, step = plant_grid(plant.horizon, plant.step, MAX_STEPS)
    if longest > plant.horizon:
        raise InputError(
            "plant.delay_bounds.1",
            f"{longest:g} s must be {plant.horizon:g} s at most, the horizon",
        )
    multiple("plant.delay_bounds.1", longest, step, "the step")
    return steps, step


def input_and_derivatives(name: str, signal: Signal, order: int) -> list[Signal]:
    """u, u', ..., up to an order."""
    signals = [signal]
    for _ in range(order):
        signals.append(signals[-1].derivative(name))
    return signals
