"""Gains of the PD/PI observer by the inequality (19).

The theorem's "min gamma subject to (19)" has no minimum: gamma tends to its infimum as gains grow
without bound, and what a solver returns are large gains on which no two solvers agree. The matrices
of least norm at a fixed gamma are no better with P1 > 0 alone: P1 becomes singular to rounding, and
the recovered gains often belong to an unstable observer. The design proposed here fixes gamma above
the floor, keeps P1 and the symmetric part of P3 away from singular, and takes the matrices of least
Frobenius norm: they are unique, and well conditioned.

The floor is from constant disturbances only. Where others are harder on the observer a factor of
1.05 is infeasible, as the solver then tells, and a larger one will do.
"""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np

from reobserve.errors import InputError
from reobserve.matrices import as_scalar
from reobserve.synthesis.extended_state.design import Design, solved
from reobserve.synthesis.extended_state.floor import as_gamma
from reobserve.synthesis.extended_state.inequality import PdPiVariables
from reobserve.synthesis.extended_state.system import AugmentedSystem

_LEAST = 0.01  # eigenvalue of P1 and of the symmetric part of P3
_EDGE = 1e-4  # from the edges of Theorem 1, where matrices of 1e4 leave solvers this wrong


def design(
    system: AugmentedSystem,
    factor: float = 1.05,
    gamma: float | None = None,
    solver: str = "CLARABEL",
    derivative: bool = True,
) -> Design:
    """The smallest P1, P2, P3, Y1, Y2, as to the sum of all squares, that solve (19).

    Subject to P1 >= 0.01 I and P3 + P3^T >= 0.02 I.

    Parameters
    ----------
    system
        The plant.
    factor
        gamma as a multiple of its floor, above one.
    gamma
        The bound of the norm itself, above the floor; it replaces ``factor``.
    solver
        CLARABEL or SCS.
    derivative
        Whether Ld may be other than zero. Without, Y2 = 0, it is a PI observer (6) that is designed
        by the same criterion.

    Raises
    ------
    InputError
        If gamma is not above the floor, the solver does not end with "optimal", or the certificate
        does not hold.
    """
    from cvxpy.atoms.sum_squares import sum_squares

    gamma = as_gamma(system, factor, gamma)
    variables = _variables(system, derivative)
    matrices = [variables.P1, variables.P2, variables.P3, variables.Y1]
    matrices += [variables.Y2] if derivative else []
    least = _LEAST * np.eye(system.size)
    return solved(
        f"{'PD/PI' if derivative else 'PI'}, least norm",
        system,
        variables,
        gamma,
        sum(sum_squares(matrix) for matrix in matrices),
        [variables.P1 >> least, variables.P3 + variables.P3.T >> 2.0 * least],
        solver,
    )


def design_least_gamma(
    system: AugmentedSystem, decay: float = 0.0, bound: float = inf, solver: str = "CLARABEL"
) -> Design:
    """Theorem 1: min gamma subject to (19), and to -``bound`` < Re s < -``decay`` of all poles.

    Raises
    ------
    InputError
        If ``decay`` and ``bound`` [1/s] are not 0 <= decay < bound, the solver does not end with
        "optimal", or the certificate does not hold.
    """
    import cvxpy

    decay = as_scalar("decay", decay)
    if not 0 <= decay < bound:
        raise InputError("decay", f"{decay:g} must be at least zero and below the bound {bound:g}")
    variables, gamma = _variables(system), cvxpy.Variable()
    positive: Any = variables.P1 >> _EDGE * np.eye(system.size)
    return solved(
        "PD/PI, least gamma",
        system,
        variables,
        gamma,
        gamma,
        [positive],
        solver,
        decay,
        bound,
        _EDGE,
    )


def _variables(system: AugmentedSystem, derivative: bool = True) -> PdPiVariables:
    import cvxpy

    size, outputs = system.size, system.outputs
    square, flat = (size, size), (outputs, size)
    return PdPiVariables(
        cvxpy.Variable(square, symmetric=True),
        cvxpy.Variable(square),
        cvxpy.Variable(square),
        cvxpy.Variable(flat),
        cvxpy.Variable(flat) if derivative else np.zeros(flat),
    )
