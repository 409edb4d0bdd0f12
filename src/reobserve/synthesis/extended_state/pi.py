"""Gains of the classical PI observer (6).

The paper takes them from the feasibility of a linear matrix inequality. Here it is the Lyapunov
inequality with a decay rate alpha,

    P1 Ao + Ao^T P1 + 2 alpha P1 < 0,    P1 > 0,    P1 L = Y^T,

which is homogeneous and has many solutions. Which one is taken decides how fast the observer is,
and the paper does not say. What a solver returns for feasibility alone moves by tens of per cent
with the kernels of BLAS, so three are proposed that are unique (`SOLUTIONS`).
"""

from __future__ import annotations

from dataclasses import replace
from math import inf

import numpy as np

from reobserve.core.arguments import as_kind, as_word
from reobserve.synthesis.extended_state import pd_pi
from reobserve.synthesis.extended_state.central_path import (
    Constraint,
    MatrixTerm,
    Problem,
    minimiser,
)
from reobserve.synthesis.extended_state.certificate import as_strip
from reobserve.synthesis.extended_state.design import (
    CertifiedGains,
    accepted,
    in_some_units,
    optimised,
)
from reobserve.synthesis.extended_state.feasible_point import strictly_feasible
from reobserve.synthesis.extended_state.inequality import PiVariables
from reobserve.synthesis.extended_state.matrix_terms import (
    Units,
    above,
    even_units,
    pi_constraints,
)
from reobserve.synthesis.extended_state.polishing import polished
from reobserve.synthesis.extended_state.system import AugmentedSystem

# Which solution of the inequality is taken: the one of minimum Frobenius norm with P1 >= I; the
# analytic centre of all with P1 > 0; or the one of largest margin. Of the latter two the norm is
# bounded, and P1 < I fixes the scale: P1 > 0 and P1 >= I have the same gains, by homogeneity. With
# the norm alone to fix it the centre would be several times as slow as what Clarabel returns.
SOLUTIONS = ("minimum_norm", "positive", "largest_margin")

_ADVICE = "a smaller decay, or a faster filter (Az, filter_rate), leaves gains more freedom"
_GAP = 1e-5  # of the sum of squares to its optimum, relative
_RADIUS = 100.0  # Frobenius norm of P1 and Y, without which gains tend to infinity
_MARGIN_GAP = 1e-3  # of the margin to the largest


def design(
    system: AugmentedSystem,
    factor: float = 1.05,
    gamma: float | None = None,
    solver: str = "CLARABEL",
) -> CertifiedGains:
    """Optimise as `pd_pi.design` does, with Ld = 0.

    Indriawati, Agustinah & Jazidie, (6) and Section IV, Remark.
    """
    return pd_pi.design(system, factor, gamma, solver, derivative=False)


def design_feasible(
    system: AugmentedSystem,
    decay: float,
    solver: str = "CLARABEL",
    solution: str = "minimum_norm",
) -> CertifiedGains:
    """A solution P1 and Y of the inequality, with poles left of -``decay`` [1/s].

    Indriawati, Agustinah & Jazidie, (6).

    Parameters
    ----------
    system, decay
        The plant, and alpha.
    solver
        CLARABEL or SCS.
    solution
        One of `SOLUTIONS`, each of which is unique in the units of the system. That of minimum norm
        is within 1e-5 of its optimum, and none is below the design's ``lower``.
    """
    decay, _ = as_strip(decay, inf)
    size = as_kind("system", system, AugmentedSystem).size
    as_word("solution", solution, SOLUTIONS)

    def attempt(units: Units | None) -> CertifiedGains:
        if solution != "minimum_norm":
            return _inside(system, decay, solver, solution, units)
        shapes = {"P1": (size, size), "Y": (system.outputs, size)}
        constraints = (*pi_constraints(system, decay, units), above("P1", size, 1.0))
        problem = Problem(shapes, frozenset({"P1"}), constraints, _GAP)
        method = "PI, feasible"
        return optimised(method, system, problem, PiVariables, None, solver, decay, units=units)

    return in_some_units(attempt, lambda: even_units(system), solver, _ADVICE)


def _inside(
    system: AugmentedSystem, decay: float, solver: str, solution: str, units: Units | None
) -> CertifiedGains:
    """The design of a solution far inside the inequality, polished to all digits.

    The matrices are those of minimum gamma where -gamma I is the margin of all that is positive, or
    where nothing but gamma > 0 holds gamma, so that it is the barriers that decide.
    """
    size, eye = system.size, np.eye(system.size)
    (lyapunov,), positive = pi_constraints(system, decay, units), above("P1", size, 0.0)
    constraints = [lyapunov, positive]
    if solution == "largest_margin":
        constraints = [replace(lyapunov, slope=eye), replace(positive, slope=2.0 * eye)]
    else:
        nothing = MatrixTerm("P1", np.zeros((1, size)), np.zeros((size, 1)))
        constraints.append(Constraint(np.zeros((1, 1)), (nothing,), np.ones((1, 1))))
    constraints.append(Constraint(2.0 * eye, (MatrixTerm("P1", -eye, eye),)))
    shapes = {"P1": (size, size), "Y": (system.outputs, size)}
    problem = Problem(shapes, frozenset({"P1"}), tuple(constraints), _MARGIN_GAP, _RADIUS)
    start, status = strictly_feasible(problem, solver)
    x = np.array([float(entry) for entry in polished(problem, minimiser(problem, start)).x])
    matrices = problem.matrices(x)
    matrices = matrices if units is None else units.original(matrices)
    method = f"PI, feasible, {solution.replace('_', ' ')}"
    variables = PiVariables(matrices["P1"], matrices["Y"])
    objective = float(x[-1]) if solution == "largest_margin" else 0.0
    return accepted(method, system, variables, None, solver, status, objective, decay)
