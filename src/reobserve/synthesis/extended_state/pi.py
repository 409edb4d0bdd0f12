"""Gains of the classical PI observer (6).

The paper takes them from the feasibility of a linear matrix inequality. Here it is the Lyapunov
inequality with a decay rate alpha,

    P1 Ao + Ao^T P1 + 2 alpha P1 < 0,    P1 > 0,    P1 L = Y^T,

which is homogeneous and has many solutions: which one a solver returns depends on how the problem
is posed, and with it how fast the observer is (`SOLUTIONS`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.core.matrices import as_scalar
from reobserve.synthesis.extended_state import pd_pi
from reobserve.synthesis.extended_state.central_path import Problem
from reobserve.synthesis.extended_state.certificate import certify
from reobserve.synthesis.extended_state.design import Design, optimised
from reobserve.synthesis.extended_state.feasible_point import solve
from reobserve.synthesis.extended_state.inequality import PiVariables
from reobserve.synthesis.extended_state.matrix_terms import above, pi_constraints
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains

# Which solution of the inequality is taken: with P1 >= I the one of least Frobenius norm, any one
# with P1 > 0 or with P1 >= I, or the one that is farthest inside where P1 <= I and |Y| is bounded.
SOLUTIONS = ("least_norm", "positive", "above_identity", "largest_margin")

_GAP = 1e-5  # of the sum of squares to its optimum, relative
_STRICT = 1e-6  # what > 0 is for a solver
_LARGEST = 100.0  # Frobenius norm of Y, without which the margin is largest at infinite gains
_DIGITS = 4  # of the largest gain


def design(
    system: AugmentedSystem,
    factor: float = 1.05,
    gamma: float | None = None,
    solver: str = "CLARABEL",
) -> Design:
    """By optimisation as in `pd_pi.design`, with Ld = 0.

    Indriawati, Agustinah & Jazidie, (6) and Section IV, Remark.
    """
    return pd_pi.design(system, factor, gamma, solver, derivative=False)


def design_feasible(
    system: AugmentedSystem,
    decay: float,
    solver: str = "CLARABEL",
    solution: str = "least_norm",
) -> Design:
    """A solution P1 and Y of the inequality, with poles left of -``decay`` [1/s].

    Indriawati, Agustinah & Jazidie, (6).

    Parameters
    ----------
    system, decay
        The plant, and alpha.
    solver
        CLARABEL or SCS.
    solution
        One of `SOLUTIONS`. The one of least norm is the point of the central path where the sum of
        squares is within 1e-5 of its optimum: unique, well conditioned, and none is below the
        design's ``lower``. Of the others the gains are those that the solver returns, rounded to
        four digits of the largest, which is why they are the same on other processors.

    Raises
    ------
    InputError
        If ``decay`` is below zero, the solution is none of these, the solver does not end with
        "optimal", or the certificate does not hold.
    """
    decay = as_scalar("decay", decay)
    if decay < 0:
        raise InputError("decay", f"{decay:g} must be at least zero")
    size = as_kind("system", system, AugmentedSystem).size
    if solution not in SOLUTIONS:
        raise InputError("solution", f"{solution!r} must be one of {', '.join(SOLUTIONS)}")
    if solution != "least_norm":
        return _returned(system, decay, solver, solution)
    shapes = {"P1": (size, size), "Y": (system.outputs, size)}
    constraints = (*pi_constraints(system, decay), above("P1", size, 1.0))
    problem = Problem(shapes, frozenset({"P1"}), constraints, _GAP)
    return optimised("PI, feasible", system, problem, PiVariables, None, solver, decay)


def _returned(system: AugmentedSystem, decay: float, solver: str, solution: str) -> Design:
    """The design of a solution as a solver returns it, rounded."""
    cvxpy = package("cvxpy", "solve matrix inequalities")
    package("flint", "prove a design")
    one, size = np.eye(system.size), system.size
    found = PiVariables(
        cvxpy.Variable((size, size), symmetric=True), cvxpy.Variable((system.outputs, size))
    )
    left: Any = found.inequalities(system, None, decay)[0][0][0]
    margin: Any = cvxpy.Variable() if solution == "largest_margin" else _STRICT
    least = 1.0 if solution == "above_identity" else margin
    bounds = [found.P1 >> least * one, left << -margin * one]
    if solution == "largest_margin":
        bounds += [found.P1 << one, cvxpy.norm(found.Y, "fro") <= _LARGEST]
        stated: Any = cvxpy.Problem(cvxpy.Maximize(margin), bounds)
    else:
        stated = cvxpy.Problem(cvxpy.Minimize(0), bounds)
    solve(stated, solver)
    L = PiVariables(np.array(found.P1.value), np.array(found.Y.value)).gains().L
    L = np.round(L, _DIGITS - 1 - int(np.floor(np.log10(np.abs(L).max()))))
    gains = Gains(L, np.zeros(L.shape))
    certificate = certify(system, gains, decay=decay)
    if not certificate.holds:
        raise InputError("solver", f"{solver} said {stated.status}, but {certificate.reason}")
    method = f"PI, feasible, {solution.replace('_', ' ')}"
    return Design(method, gains, None, solver, stated.status, float(stated.value), certificate)
