"""From the ledger's values to models, signals and the grid."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.errors import InputError, located
from reobserve.matrices import as_floats, as_positive, as_scalar, as_vector
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
    with located("plant"):
        step = as_positive("step", plant["step"])
        horizon = as_positive("horizon", plant["horizon"])
        if horizon > MOST_STEPS * step:
            raise InputError(
                "horizon",
                f"{horizon:g} s is {horizon / step:.3g} steps, must be {MOST_STEPS:g} at most",
            )
        steps = multiple("horizon", horizon, step, "the step")
        multiple("delay_bounds.1", most, step, "the step")
    return steps, step


def multiple(name: str, interval: float, step: float, what: str) -> int:
    """How often ``step`` fits into ``interval``; `InputError` if that is no whole number."""
    count = round(interval / step)
    if count < 1 or abs(count * step - interval) > 1e-9 * interval:
        raise InputError(name, f"{interval:g} s must be a whole multiple of {what}, {step:g} s")
    return count


def stride(plant: Settings, step_size: Any) -> int:
    """Plant samples in half a step of an observer; `InputError` if that is no whole number."""
    step = as_positive("plant.step", plant["step"])
    half = 0.5 * as_positive("step_size", step_size)
    return multiple("step_size", half, step, "plant.step, two in a step")


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


def noise_hold(plant: Settings) -> int:
    """Plant samples for which noise is held; an even number, so that it jumps between steps."""
    period = as_positive("plant.noise_period", plant["noise_period"])
    step = float(as_floats("plant.step", plant["step"]))
    hold = round(period / step)
    if hold < 2 or hold % 2 or abs(hold * step - period) > 1e-9 * period:
        raise InputError(
            "plant.noise_period",
            f"{period:g} s must be a multiple of {2 * step:g} s (two samples)",
        )
    return hold
