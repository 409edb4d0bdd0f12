"""Autonomous plant with polynomial dynamics and outputs, such as Van der Pol's oscillator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import MOST_STEPS, as_kind, as_whole
from reobserve.core.errors import DivergenceError, InputError
from reobserve.core.finite import finite
from reobserve.core.kernel import kernel
from reobserve.core.matrices import as_floats, as_positive, as_vector
from reobserve.polynomials.evaluation_kernels import Polynomials, evaluate, polynomials
from reobserve.systems.polynomial import PolynomialSystem

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PolynomialPlant:
    """The plant x' = f(x), y = h(x) (Thomas, Kwatny & Chang, (1))."""

    system: PolynomialSystem

    def __post_init__(self) -> None:
        as_kind("system", self.system, PolynomialSystem)

    def simulate(self, initial_state: ArrayLike, step: float, steps: int) -> Array:
        """States at multiples of ``step`` [s], shape (steps + 1, n), by classical Runge-Kutta.

        Raises
        ------
        InputError
            If ``initial_state`` is not n numbers, ``step`` is not positive or there is none.
        DivergenceError
            If the state leaves the range of floating-point numbers.
        """
        start = as_vector("initial_state", initial_state, self.system.states)
        step = as_positive("step", step)
        steps = as_whole("steps", steps, 1, MOST_STEPS)
        states = np.empty((steps + 1, len(start)))
        states[0] = start
        f = polynomials(self.system.dynamics)
        work = np.empty(len(f.parent)), np.empty((5, len(start)))
        last = _simulate(f, work, step, states)
        if last < steps:
            raise DivergenceError("plant", last * step)
        return states

    @finite("states")
    def output(self, states: Array) -> Array:
        """The output y, shape (..., p), at states of shape (..., n).

        Raises
        ------
        InputError
            If the states are no numbers, not n of them, or so large that the output overflows.
        """
        points = as_floats("states", states)
        if points.ndim == 0 or points.shape[-1] != self.system.states:
            raise InputError(
                "states", f"has shape {points.shape}, must end in {self.system.states}"
            )
        values: Array = self.system.output(points)
        return values


@kernel
def _simulate(f: Polynomials, work: tuple[Array, Array], step: float, states: Array) -> int:
    """Fill ``states`` from its first row, and return the last index with a finite state.

    ``work`` are buffers for the monomials, and for the slopes and a point.
    """
    n = states.shape[1]
    buffer, points = work
    k1, k2, k3, k4, x = points[0], points[1], points[2], points[3], points[4]
    for k in range(len(states) - 1):
        # k1 = f(x),   k2 = f(x + h/2 k1),   k3 = f(x + h/2 k2),   k4 = f(x + h k3)
        evaluate(f, states[k], buffer, k1)
        for i in range(n):
            x[i] = states[k, i] + 0.5 * step * k1[i]
        evaluate(f, x, buffer, k2)
        for i in range(n):
            x[i] = states[k, i] + 0.5 * step * k2[i]
        evaluate(f, x, buffer, k3)
        for i in range(n):
            x[i] = states[k, i] + step * k3[i]
        evaluate(f, x, buffer, k4)
        # x(t + h) = x(t) + h/6 (k1 + 2 k2 + 2 k3 + k4)
        for i in range(n):
            after = states[k, i] + step / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])
            if not np.isfinite(after):
                return k
            states[k + 1, i] = after
    return len(states) - 1
