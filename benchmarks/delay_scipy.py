"""The pendulum with its delay on the ramp, and the extended observer behind it, by `solve_ivp`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reobserve_papers.plants.pendulum import pendulum

Array = NDArray[np.float64]

MODEL = pendulum(gravity=9.81, length=0.5, mass=0.2, friction=0.3)
RHO = 5.0
SLOPE = 0.009  # of the ramp [N m/s]


def solve(begin: list[float], edges: tuple[float, ...], tolerance: float) -> Array:
    """States at the ends of the segments, of the plant or with those of the observer behind."""
    swing, damping, torque = MODEL.parameters.tolist()
    l1, l2, l3 = 3.0 * RHO, 3.0 * RHO**2, RHO**3

    def plant(t: float, x: Array, delay: float) -> tuple[float, float]:
        late = delay or 0.8 + 0.45 * math.sin(0.2 * t)
        return x[1], -swing * math.sin(x[0]) - damping * x[1] + torque * SLOPE * (t - late)

    def both(t: float, x: Array, delay: float) -> tuple[float, ...]:
        xi, error = -torque * SLOPE, x[2] - x[0]
        push = -swing * math.sin(x[2]) - damping * x[3] + xi * x[4] + torque * SLOPE * t
        estimate = (x[3] - l1 * error, push - l2 * error, -l3 * error / xi)
        return *plant(t, x, delay), *estimate

    found, x = [], np.array(begin)
    for segment in range(len(edges) - 1):
        delay = (0.6, 1.2, 0.3, 0.0)[segment]
        law: Callable[..., Any] = plant if len(begin) == 2 else both
        span = edges[segment : segment + 2]
        done = solve_ivp(law, span, x, "DOP853", args=(delay,), rtol=tolerance, atol=tolerance)
        x = done.y[:, -1]
        found.append(x)
    return np.array(found)
