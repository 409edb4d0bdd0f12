"""From the ledger's values to models, signals and the grid."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError, located
from reobserve.grid import multiple, plant_grid
from reobserve.matrices import as_scalar, as_vector
from reobserve.plants.first_order_lag import first_order_lag
from reobserve.plants.pendulum import pendulum
from reobserve.signals import Signal
from reobserve.triangular_model import TriangularModel

Settings = dict[str, Any]
Array = NDArray[np.float64]

# The units of state, output, input and its first two derivatives, by model.
UNITS = {
    "pendulum": ("rad, rad/s", "rad", "N m", "N m/s, N m/s^2"),
    "lag": ("1", "1", "1", "1/s, 1/s^2"),
}
MODELS = tuple(UNITS)

MOST_DERIVATIVES = 2  # of u, in a plant's record and by the differentiator (37)

MOST_STEPS = 5_000_000  # of a plant record: a gigabyte


def check_model(name: Any) -> None:
    """Refuse a name that is none of a model."""
    if name not in MODELS:
        raise InputError("model", f"{name!r} must be one of {', '.join(MODELS)}")


def build_model(plant: Settings, name: Any) -> TriangularModel:
    """The model that a scenario names; `InputError` if there is none of that name."""
    check_model(name)
    if name == "lag":
        return first_order_lag()
    with located("plant"):
        return pendulum(*(plant[key] for key in ("gravity", "length", "mass", "friction")))


def delay_bounds(plant: Settings) -> tuple[float, float]:
    """The interval of the delay [s]; `InputError` if it is none."""
    least, most = as_vector("plant.delay_bounds", plant["delay_bounds"], 2)
    if not 0.0 <= least < most:
        raise InputError("plant.delay_bounds", f"[{least:g}, {most:g}] s must be 0 or more, rising")
    return float(least), float(most)


def grid(plant: Settings) -> tuple[int, float]:
    """The number of plant steps and the step [s]; the greatest delay is a multiple of it, too.

    Raises
    ------
    InputError
        If horizon, step and greatest delay are not positive or do not fit.
    """
    most = delay_bounds(plant)[1]
    steps, step = plant_grid(plant, MOST_STEPS)
    multiple("plant.delay_bounds.1", most, step, "the step")
    return steps, step


def input_and_derivatives(name: str, signal: Signal, order: int) -> list[Signal]:
    """u, u', ..., up to an order.

    Raises
    ------
    InputError
        If a term has no derivative in closed form.
    """
    found = [signal]
    for _ in range(order):
        found.append(found[-1].derivative(name))
    return found


def noise_deviation(name: str, value: Any) -> float:
    """A standard deviation, not negative."""
    deviation = as_scalar(name, value)
    if deviation < 0:
        raise InputError(name, f"{deviation:g} must not be negative")
    return deviation
