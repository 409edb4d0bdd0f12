"""Stable limit cycles of polynomial systems, and how errors grow or decay along them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from itertools import count

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_floats, as_positive, as_vector
from reobserve.systems.polynomial import PolynomialSystem

Array = NDArray[np.float64]

_MOST_CALLS = 100_000
_SOLVER = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13}


@dataclass(frozen=True)
class LimitCycle:
    """A stable periodic orbit: its ``period`` [s] and one of its points ``start``, shape (n,)."""

    system: PolynomialSystem
    period: float
    start: Array

    def points(self, count: int) -> Array:
        """``count`` points, evenly spaced in time, from the start on, shape (count, n)."""
        from scipy.integrate import solve_ivp

        time = np.arange(count) * (self.period / count)
        solution = solve_ivp(
            _slope(self.system), (0, self.period), self.start, t_eval=time, **_SOLVER
        )
        states: Array = solution.y.T
        return states


@np.errstate(over="ignore", invalid="ignore")  # a state that is not finite leads to none
def limit_cycle(system: PolynomialSystem, initial_state: ArrayLike, settle: float) -> LimitCycle:
    """The limit cycle that a trajectory has reached after ``settle`` seconds."""
    from scipy.integrate import solve_ivp

    slope = _slope(as_kind("system", system, PolynomialSystem))
    settle = as_positive("settle", settle)
    first = as_vector("initial_state", initial_state, system.states)
    there = solve_ivp(slope, (0, settle), first, **_SOLVER)
    start: Array = there.y[:, -1]
    normal = slope(0.0, start)

    def section(_: float, x: Array) -> float:
        return float(normal @ (x - start))

    section.direction = 1.0  # type: ignore[attr-defined]
    again = solve_ivp(slope, (0, settle), start, events=section, **_SOLVER)
    # A state at rest moves little, compared with its distance from the origin.
    extent = float(np.max(np.ptp(again.y, axis=1)))
    resting = extent < 1e-6 * float(np.linalg.norm(start)) or extent < 1e-9
    for time, state in zip(again.t_events[0], again.y_events[0], strict=True):
        if not resting and time > 1e-6 and np.linalg.norm(state - start) < 1e-6 * extent:
            return LimitCycle(system, float(time), start)
    raise InputError(
        "initial_state", f"leads to no limit cycle within {settle:g} s, nor back within as many"
    )


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of a singular one: -inf
def floquet_exponents(cycle: LimitCycle, jacobians: Array) -> Array:
    """Real parts [1/s] of the Floquet exponents of e' = J(x(t)) e along a limit cycle.

    The largest exponent comes first; an error shrinks by e^(exponent * period) in each turn.

    Parameters
    ----------
    cycle
        The limit cycle.
    jacobians
        J at an even number of `LimitCycle.points`, shape (2 m, n, n). The fundamental matrix is
        integrated by the classical Runge-Kutta method in m steps.
    """
    as_kind("cycle", cycle, LimitCycle)
    jacobians = as_floats("jacobians", jacobians)
    n = jacobians.shape[-1] if jacobians.ndim else 0
    if jacobians.shape[1:] != (n, n) or jacobians.size == 0 or len(jacobians) % 2:
        raise InputError("jacobians", f"has shape {jacobians.shape}, must be (2 m, n, n)")
    h = 2.0 * cycle.period / len(jacobians)
    start, middle = jacobians[0::2], jacobians[1::2]
    end = np.roll(start, -1, axis=0)
    k1 = start
    k2 = middle @ (np.eye(n) + 0.5 * h * k1)
    k3 = middle @ (np.eye(n) + 0.5 * h * k2)
    k4 = end @ (np.eye(n) + h * k3)
    steps = np.eye(n) + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    fundamental = reduce(lambda before, step: step @ before, steps)
    if not np.isfinite(fundamental).all():
        raise InputError("jacobians", "are so large that the fundamental matrix is not finite")
    multipliers = np.linalg.eigvals(fundamental)
    exponents: Array = np.sort(np.log(np.abs(multipliers)))[::-1] / cycle.period
    return exponents


def _slope(system: PolynomialSystem) -> Callable[[float, Array], Array]:
    calls = count()

    def slope(_: float, x: Array) -> Array:
        if next(calls) > _MOST_CALLS:
            raise InputError("settle", f"takes more than {_MOST_CALLS} slopes; make it shorter")
        x_dot: Array = system.dynamics(x)
        return x_dot

    return slope
