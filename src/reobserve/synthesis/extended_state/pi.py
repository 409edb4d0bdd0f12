"""Gains of the classical PI observer (6).

The paper takes them from the feasibility of a linear matrix inequality: any solution will do, and
it is up to the solver. Here it is the Lyapunov inequality with a decay rate, which is homogeneous:
P1 >= I fixes the scale, and of all solutions the one of least Frobenius norm is taken, but for a
gap that makes it a point of the central path: unique, and well conditioned.
"""

from __future__ import annotations

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_scalar
from reobserve.synthesis.extended_state import pd_pi
from reobserve.synthesis.extended_state.central_path import Problem
from reobserve.synthesis.extended_state.design import Design, optimised
from reobserve.synthesis.extended_state.inequality import PiVariables
from reobserve.synthesis.extended_state.matrix_terms import above, pi_sides
from reobserve.synthesis.extended_state.system import AugmentedSystem

_GAP = 1e-5  # of the sum of squares to its optimum, relative


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


def design_feasible(system: AugmentedSystem, decay: float, solver: str = "CLARABEL") -> Design:
    """The smallest P1 and Y, as to the sum of all squares, with poles left of -``decay`` [1/s].

    Indriawati, Agustinah & Jazidie, (6).

    To 1e-5 of the sum: none is below the design's ``lower``.

    Raises
    ------
    InputError
        If ``decay`` is below zero, the solver does not end with "optimal", or the certificate does
        not hold.
    """
    decay = as_scalar("decay", decay)
    if decay < 0:
        raise InputError("decay", f"{decay:g} must be at least zero")
    size = as_kind("system", system, AugmentedSystem).size
    shapes = {"P1": (size, size), "Y": (system.outputs, size)}
    sides = (*pi_sides(system, decay), above("P1", size, 1.0))
    problem = Problem(shapes, frozenset({"P1"}), sides, _GAP)
    return optimised("PI, feasible", system, problem, PiVariables, None, solver, decay)
