"""The continuous ILO as it would be written without a compiled library: numpy and scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from benchmarks.problem import INTERVAL, known_control, measured_rate

Array = NDArray[np.float64]

# Instants of an interval at which v is kept for the next one (Chebyshev-Lobatto points), and
# what turns the values there into the coefficients of a polynomial.
_POWERS = np.arange(12)
_NODES = 0.5 - 0.5 * np.cos(np.pi * _POWERS / _POWERS[-1])
_FIT = np.linalg.inv(np.vander(_NODES, increasing=True))


class NumpyObserver:
    """The loop of the library with numpy's vectors and matrices, step by step."""

    def __init__(self, constants: tuple[Any, ...], delay: int, estimate: Array) -> None:
        self.J, self.inverse, self.L, self.B, self.Bf, self.K1, self.K2, self.h = constants
        self.history = np.zeros((delay, 3, 3))
        self.estimate = estimate
        self.count = 0

    def slope(self, w: Array, rate: Array, known: Array) -> Array:
        """The derivative of the estimate."""
        x, y, z = w
        a, b, c = self.J @ w
        gyroscopic = np.array([y * c - z * b, z * a - x * c, x * b - y * a])
        slope: Array = self.inverse @ (known + self.L @ (rate - w) - gyroscopic)
        return slope

    def step(self, rate: Array, control: Array) -> tuple[Array, Array]:
        """One step over three samples: estimate and v at its start."""
        h, w = self.h, self.estimate
        past = self.history[self.count % len(self.history)]
        learned = past @ self.K1.T
        start, middle, end = control @ self.B.T + learned @ self.Bf.T
        k1 = self.slope(w, rate[0], start)
        k2 = self.slope(w + 0.5 * h * k1, rate[1], middle)
        k3 = self.slope(w + 0.5 * h * k2, rate[1], middle)
        k4 = self.slope(w + h * k3, rate[2], end)
        after = w + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        last = self.slope(after, rate[2], end)
        between = 0.5 * (w + after) + 0.125 * h * (k1 - last)
        past[:] = learned + (rate - np.stack((w, between, after))) @ self.K2.T
        self.estimate = after
        self.count += 1
        return w, past[0]

    def run(self, rate: Array, control: Array) -> tuple[Array, Array]:
        """Estimates and v at the starts of all steps of a record."""
        steps = len(rate) // 2
        rates, faults = np.empty((steps, 3)), np.empty((steps, 3))
        for k in range(steps):
            rows = slice(2 * k, 2 * k + 3)
            rates[k], faults[k] = self.step(rate[rows], control[rows])
        return rates, faults


def solve(
    constants: tuple[Any, ...], estimate: Array, intervals: int, **options: Any
) -> tuple[Array, Array]:
    """The law by `solve_ivp`, one interval of learning after the other (method of steps).

    Returns the estimate and v at the start of each interval. v of the interval before is a
    polynomial of degree 11 through its values at the nodes: an interpolation in the usual 20
    points costs more and brings less.
    """
    J, inverse, L, B, Bf, K1, K2, _ = constants
    delayed = np.zeros((len(_POWERS), 3))
    rates, faults = np.empty((intervals, 3)), np.empty((intervals, 3))
    for n in range(intervals):
        begin = n * INTERVAL
        past = _FIT @ (delayed @ (Bf @ K1).T)

        def slope(t: float, w: Array, begin: float = begin, past: Array = past) -> Array:
            x, y, z = w
            a, b, c = J @ w
            gyroscopic = np.array([y * c - z * b, z * a - x * c, x * b - y * a])
            learned = ((t - begin) / INTERVAL) ** _POWERS @ past
            torque = L @ (measured_rate(t) - w) + B @ known_control(t) + learned - gyroscopic
            slope: Array = inverse @ torque
            return slope

        nodes = begin + INTERVAL * _NODES
        nodes[-1] = begin + INTERVAL
        path = solve_ivp(slope, (begin, nodes[-1]), estimate, t_eval=nodes, **options).y.T
        delayed = delayed @ K1.T + (measured_rate(nodes) - path) @ K2.T
        rates[n], faults[n] = path[0], delayed[0]
        estimate = path[-1]
    return rates, faults
