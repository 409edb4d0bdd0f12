"""The time grid of a paper's plant, and what must fit it: observers' steps, held noise."""

from __future__ import annotations

from typing import Any

from reobserve.core.errors import InputError, located
from reobserve.core.matrices import as_positive

MAX_STEPS = 100_000_000  # of anything: more is a slip, and fits no memory


def multiple(name: str, interval: float, step: float, what: str) -> int:
    """The number of times that ``step`` fits into ``interval``, or `InputError` if not whole."""
    ratio = interval / step
    if ratio > MAX_STEPS:
        raise InputError(
            name, f"{interval:g} s is {ratio:.3g} steps, must be {MAX_STEPS:g} at most"
        )
    count = round(ratio)
    if count < 1 or abs(count * step - interval) > 1e-9 * interval:
        raise InputError(name, f"{interval:g} s must be a whole multiple of {what}, {step:g} s")
    return count


def plant_grid(horizon: float, step: float, max_steps: int) -> tuple[int, float]:
    """The number of plant steps and the step [s]."""
    with located("plant"):
        step, horizon = as_positive("step", step), as_positive("horizon", horizon)
        if horizon > max_steps * step:
            raise InputError(
                "horizon",
                f"{horizon:g} s is {horizon / step:.3g} steps, must be {max_steps:g} at most",
            )
        return multiple("horizon", horizon, step, "the step"), step


def stride(step: float, sampling_period: Any) -> int:
    """Plant samples in half a step of an observer, or `InputError` if that is no whole number."""
    step = as_positive("plant.step", step)
    half = 0.5 * as_positive("sampling_period", sampling_period)
    return multiple("sampling_period", half, step, "plant.step, two in a step")


def noise_hold(period: float, step: float) -> int:
    """The number of plant samples for which noise is held, even, so that it jumps between steps."""
    period = as_positive("plant.noise_period", period)
    hold = round(period / step)
    if hold < 2 or hold % 2 or abs(hold * step - period) > 1e-9 * period:
        raise InputError(
            "plant.noise_period", f"{period:g} s must be a multiple of {2 * step:g} s (two samples)"
        )
    return hold
