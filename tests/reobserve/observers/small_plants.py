"""Small plants: models with compiled functions, and trajectories by an adaptive method."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from reobserve.core.vector_field import vector_field
from reobserve.systems.triangular import TriangularModel

Array = NDArray[np.float64]

# Of a pendulum of 0.5 m and 0.2 kg: g / l, k / m and 1 / (m l^2); and where it starts.
G_OVER_L, A, GAIN = 9.81 / 0.5, 0.3 / 0.2, 1 / (0.2 * 0.5**2)
START = (0.87, 0.0)

# A delay [s] in pieces, and the times between them.
DELAYS: tuple[Callable[[float], float], ...] = (
    lambda t: 0.6,
    lambda t: 1.2,
    lambda t: 0.3,
    lambda t: 0.8 + 0.45 * float(np.sin(0.2 * t)),
)
MEET = (0, 20, 40, 60, 120)


@vector_field
def pendulum_drift(x: Any, p: Any, f: Any) -> None:
    f[0] = 0.0
    f[1] = -p[0] * math.sin(x[0]) - p[1] * x[1]


@vector_field
def lag_drift(x: Any, p: Any, f: Any) -> None:
    f[0] = -p[0] * x[0]


@vector_field
def last_parameter(y: Any, p: Any, G: Any) -> None:
    G[0] = p[len(p) - 1]


def pendulum(
    stiffness: float = G_OVER_L, friction: float = A, gain: float = GAIN
) -> TriangularModel:
    """x1' = x2, x2' = -stiffness sin x1 - friction x2 + gain u."""
    return TriangularModel(2, pendulum_drift, last_parameter, [stiffness, friction, gain])


def first_order_lag(rate: float = 1.0, gain: float = 1.0) -> TriangularModel:
    """x' = -rate x + gain u."""
    return TriangularModel(1, lag_drift, last_parameter, [rate, gain])


def pendulum_slope(x: Array, u: float) -> Array:
    """The right-hand side of `pendulum`."""
    return np.array([x[1], -G_OVER_L * np.sin(x[0]) - A * x[1] + GAIN * u])


def trajectory(
    slope: Callable[[float, Array, float], Array], start: ArrayLike, edges: Sequence[float]
) -> Callable[[Array], Array]:
    """States of x' = slope(t, x, inside) at any times from the first edge to the last.

    By a method of order 8 that restarts at each edge; ``inside`` lies between two edges, so that it
    tells on which side of a jump t is.
    """
    pieces, state = [], np.array(start, dtype=np.float64)
    for begin, end in pairwise(edges):
        middle = 0.5 * (begin + end)
        found = solve_ivp(
            lambda t, x, middle=middle: slope(t, x, middle), (begin, end), state, "DOP853",
            dense_output=True, rtol=1e-12, atol=1e-14, max_step=0.01,
        )  # fmt: skip
        assert found.success
        pieces.append(found.sol)
        state = found.y[:, -1]

    def states(time: Array) -> Array:
        place = np.searchsorted(edges[1:-1], time, side="right")
        rows = np.empty((len(time), len(state)))
        for k, piece in enumerate(pieces):
            if (here := place == k).any():
                rows[here] = piece(time[here]).T
        return rows

    return states
