"""The systems that all normal-form benchmarks share, and their methods, each with its solver."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import place_poles

from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.monomials import monomials
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.direct_t import solve_t
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve.systems.polynomial import PolynomialSystem
from reobserve_papers.papers.lie.lie_transform import lie_transform

Array = NDArray[np.float64]


def van_der_pol(degree: int, *, exact: bool = False) -> NormalFormProblem:
    """The oscillator x1' = x2, x2' = -x1 + x2 - x1^2 x2, y = x1, with the gain (-2, -4)."""
    dynamics = _terms(
        "f", [(1, (0, 1), 1), (2, (1, 0), -1), (2, (0, 1), 1), (2, (2, 1), -1)], exact
    )
    output = PolynomialMap.from_terms("h", [_term(1, (1, 0), 1)], 1, 2, exact=exact)
    gain = [_term(1, (1,), -2), _term(2, (1,), -4)]
    injection = PolynomialMap.from_terms("l", gain, 2, 1, exact=exact)
    return NormalFormProblem(PolynomialSystem(dynamics, output), injection, degree)


def dense_cubic(states: int, degree: int) -> NormalFormProblem:
    """All terms of f and h up to degree 3, drawn by a fixed seed; one output, no resonance.

    The eigenvalues of F lie to the right of the imaginary axis and those of A to the left, so no
    sum of the former is near one of the latter, and rounding leaves many digits to compare.
    """
    draw = np.random.default_rng(2024 + states)
    basis = monomials(states, 3)
    f = 0.3 * draw.standard_normal((states, len(basis.exponents)))
    h = 0.3 * draw.standard_normal((1, len(basis.exponents)))
    f[:, 0] = h[:, 0] = 0
    skew = np.triu(draw.standard_normal((states, states)), 1)
    F = f[:, basis.part(1)] = 0.4 * np.eye(states) + skew - skew.T
    H = h[:, basis.part(1)] = draw.standard_normal((1, states))
    poles = -0.5 - 0.2 * np.arange(states)
    gain = -place_poles(F.T, H.T, poles).gain_matrix.T
    system = PolynomialSystem(PolynomialMap(basis, f), PolynomialMap(basis, h))
    return NormalFormProblem(system, PolynomialMap.linear(gain), degree)


def methods(problem: NormalFormProblem) -> dict[str, Callable[[], Any]]:
    """S, T, both, the inversion and the Lie recursion; the solver's construction included."""
    series = PolynomialMap(problem.basis, solve_s(problem, solver_for(problem)))

    def both() -> tuple[Array, Array]:
        solver = solver_for(problem)
        return solve_s(problem, solver), solve_t(problem, solver)

    return {
        "S": lambda: solve_s(problem, solver_for(problem)),
        "T": lambda: solve_t(problem, solver_for(problem)),
        "S and T": both,
        "inverse of S": lambda: series.inverse().coefficients,
        "Lie": lambda: lie_transform(problem, solver_for(problem)),
    }


def _terms(name: str, terms: list[tuple[int, tuple[int, ...], int]], exact: bool) -> PolynomialMap:
    return PolynomialMap.from_terms(name, [_term(*term) for term in terms], 2, 2, exact=exact)


def _term(component: int, powers: tuple[int, ...], coefficient: int) -> dict[str, Any]:
    return {"component": component, "powers": list(powers), "coefficient": coefficient}
