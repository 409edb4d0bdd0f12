"""A triangular model as YAML states it, and what high gain proves on one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from reobserve.core.errors import InputError, nearest
from reobserve.core.matrices import FloatArray
from reobserve.estimation.families.signals import check_keys, named
from reobserve.estimation.observer_design import System
from reobserve.observers.fixed_step import check_rate
from reobserve.synthesis.high_gain_design import lyapunov_matrix
from reobserve.systems.triangular import TriangularModel
from reobserve.systems.triangular_text import triangular_model

Array = FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class TriangularSystem(System):
    """System x1' = x2 + f1(x1), ..., xn' = fn(x) + G(x1) u with y = x1.

    ``drift`` is f by state, ``input_gain`` G, text each. ``lipschitz`` holds bounds, by state i
    and then by state j, of what f_i changes with x_j; what it leaves out is zero.
    """

    drift: dict[str, str | float]
    input_gain: str | float
    lipschitz: dict[str, dict[str, float]] | None = None

    def __post_init__(self) -> None:
        if not self.states:
            raise InputError("states", "are none, must be one or more")
        first, unit = next(iter(self.states.items()))
        if len(self.measurements) > 1:
            problem = f"name {len(self.measurements)} signals, must name one, which is {first}"
            raise InputError("measurements", problem)
        for name, measured in self.measurements.items():
            if measured != unit:
                problem = f"has the unit {measured}, must have that of {first}, {unit}"
                raise InputError(f"measurements.{name}", f"{problem}: it is measured")
        check_keys("drift", self.drift, self.states)
        for row, bounds in (self.lipschitz or {}).items():
            self._check_state(f"lipschitz.{row}", row)
            for column, bound in bounds.items():
                place, names = f"lipschitz.{row}.{column}", list(self.states)
                self._check_state(place, column)
                if names.index(column) > names.index(row):
                    raise InputError(place, f"must not be stated: {row} is before {column}")
                if not 0 <= bound < np.inf:
                    raise InputError(place, f"{bound:g} must be finite, 0 or more")

    def _check_state(self, place: str, name: str) -> None:
        if name not in self.states:
            raise InputError(place, f"is of no state{nearest(name, self.states)}")

    @cached_property
    def model(self) -> TriangularModel:
        """The model of f and G, compiled, or `InputError` for the key whose text cannot be."""
        names = list(self.states)
        drift = [str(self.drift[name]) for name in names]
        with named(drift=("drift", names)):
            return triangular_model(names, drift, str(self.input_gain))

    @property
    def start(self) -> Array:
        """The initial state, by default the origin."""
        n = len(self.states)
        return np.zeros(n) if self.initial_state is None else np.array(self.initial_state)

    def decay(self, rho: float) -> float | None:
        """A rate [1/s] at which errors are proved to decay, or None if no bounds are stated.

        V = e^T S e has V' <= -rho V + 2 e^T S (f(x^) - f(x)). With e_i over rho^(i - 1), S is that
        of rho = 1 but for a factor, and the difference of f at most M |e| with M_ij = lipschitz_ij
        rho^(j - i), so that V' <= -(rho - 2 c |M|) V, c the root of the condition number of
        S; and e decays with half the rate of V.
        """
        if self.lipschitz is None:
            return None
        n, names = len(self.states), list(self.states)
        M = np.zeros((n, n))
        for row, bounds in self.lipschitz.items():
            for column, bound in bounds.items():
                i, j = names.index(row), names.index(column)
                with np.errstate(over="ignore"):
                    M[i, j] = bound * np.float64(rho) ** (j - i)
        norm = float(np.linalg.norm(M, 2)) if np.isfinite(M).all() else np.inf
        eigenvalues = np.linalg.eigvalsh(lyapunov_matrix(n, 1.0))
        least = max(eigenvalues[0], np.finfo(float).tiny)  # of many states below rounding
        return 0.5 * rho - float(np.sqrt(eigenvalues[-1] / least)) * norm


def step_growth(rho: float, step: float) -> float:
    """The factor by which a step of the classical method changes an error with e' = -rho e."""
    check_rate("rho", rho, step)
    z = -rho * step
    return abs(1.0 + z * (1.0 + z / 2.0 * (1.0 + z / 3.0 * (1.0 + z / 4.0))))


def decay_sentence(certificate: Mapping[str, float]) -> str:
    """A sentence on what the certificate says of the decay of errors."""
    if "decay" not in certificate:
        return "no bounds of the drift (lipschitz) are stated: convergence is not certified"
    return (
        f"within the stated bounds of the drift errors decay by {certificate['decay']:.4g} 1/s or "
        "faster, without noise and with the input exact"
    )
