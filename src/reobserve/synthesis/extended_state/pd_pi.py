"""Gains of the PD/PI observer by the inequality (19).

The theorem's "min gamma subject to (19)" has no minimum: gamma tends to its infimum as the matrices
and the gains grow without bound, and a solver stops where its tolerance, which grows with them, is
met. With poles between -50 and -2, to take one, gamma is 1.55, 1.35 and 1.24 for matrices of norm
300, 1000 and 3000 and goes on falling; solvers end at norms beyond 1e5, with 1.07. The matrices of
minimum norm at a fixed gamma are no better with P1 > 0 alone: P1 becomes singular to rounding, and
the recovered gains often belong to an unstable observer.

So both designs proposed here keep P1 and the symmetric part of P3 away from singular. One fixes
gamma above the lower bound and takes the matrices of minimum Frobenius norm; the other takes the
minimum gamma of matrices inside a radius. Both are points of the central path, off the optimum by a
stated gap, which the dual proves. So they are unique and well conditioned: a change of the paper's
data moves gains, relatively, by some hundred times as much at most, and they are the same to ten
digits and more whatever solver and processor found where to begin. A solver alone does not give
that: with all constraints above 1e-6 the gains of minimum gamma that Clarabel returns are 10 to
100 % off and move by up to 3 % with the kernels of OpenBLAS, and with all above 0 most are refuted
by the certificate, those of minimum norm on some processors only.

The lower bound is from constant disturbances only. Where others are harder on the observer a factor
of 1.05 is infeasible, as the solver then tells, and a larger one will do.
"""

from __future__ import annotations

from math import inf

from reobserve.core.arguments import as_kind
from reobserve.core.matrices import as_positive
from reobserve.synthesis.extended_state.central_path import Constraint, Problem
from reobserve.synthesis.extended_state.certificate import as_strip
from reobserve.synthesis.extended_state.design import CertifiedGains, in_some_units, optimised
from reobserve.synthesis.extended_state.gamma_bound import as_gamma
from reobserve.synthesis.extended_state.inequality import PdPiVariables
from reobserve.synthesis.extended_state.matrix_terms import (
    Units,
    above,
    even_units,
    pd_pi_constraints,
)
from reobserve.synthesis.extended_state.system import AugmentedSystem

_LEAST = 0.01  # eigenvalue of P1 and of the symmetric part of P3
_ADVICE = (
    "a larger factor or gamma, or a faster filter (Az, filter_rate), leaves gains more freedom"
)
_ADVICE_OF_MINIMUM = "a larger radius, gap or bound, or a smaller decay, leaves gains more freedom"
_GAP = 1e-5  # of the sum of squares to its optimum, relative: none would move gains by 2e-4


def design(
    system: AugmentedSystem,
    factor: float = 1.05,
    gamma: float | None = None,
    solver: str = "CLARABEL",
    derivative: bool = True,
) -> CertifiedGains:
    """The smallest P1, P2, P3, Y1, Y2, as to the sum of all squares, that solve the inequality.

    Indriawati, Agustinah & Jazidie, (19).

    Subject to P1 >= 0.01 I and P3 + P3^T >= 0.02 I, and to 1e-5 of the sum: none is below the
    design's ``lower``. Where no such matrices are found, all this is asked of the same system in
    even units; gamma remains that of the units given, and the certificate is in these.

    Parameters
    ----------
    system
        The plant.
    factor
        gamma as a multiple of its lower bound, above one.
    gamma
        The bound of the norm itself, above the lower bound; it replaces ``factor``.
    solver
        CLARABEL or SCS.
    derivative
        Whether Ld may be other than zero. Without, Y2 = 0, it is a PI observer (6) that is designed
        by the same criterion.

    Raises
    ------
    InputError
        If gamma is not above the lower bound, the solver does not end with "optimal", or the
        certificate does not hold.
    """
    gamma = as_gamma(system, factor, gamma)
    method = f"{'PD/PI' if derivative else 'PI'}, minimum norm"

    def attempt(units: Units | None) -> CertifiedGains:
        constraints = pd_pi_constraints(system, gamma, derivative=derivative, units=units)
        problem = _problem(system, constraints, _GAP)
        return optimised(method, system, problem, PdPiVariables, gamma, solver, 0.0, inf, units)

    return in_some_units(attempt, lambda: even_units(system, gamma), solver, _ADVICE)


def design_minimum_gamma(
    system: AugmentedSystem,
    decay: float = 0.0,
    bound: float = inf,
    radius: float = 3000.0,
    solver: str = "CLARABEL",
    gap: float = 1e-6,
    derivative: bool = True,
) -> CertifiedGains:
    """The minimum gamma by the inequality, with -``bound`` < Re s < -``decay`` of all poles.

    Indriawati, Agustinah & Jazidie, (19) and Theorem 1.

    Subject to P1 >= 0.01 I and P3 + P3^T >= 0.02 I, and a sum of the squares of P1, P2, P3, Y1, Y2
    within that of the ``radius``. The design's ``lower`` is the ``gap`` below its gamma, which has
    to be larger where floats cannot follow the central path so far: 1e-3 for a gamma of some units.
    Without ``derivative`` it is a PI observer (6), as in `design`.

    Raises
    ------
    InputError
        If ``decay`` and ``bound`` [1/s] are not 0 <= decay < bound, the radius or the
        gap is too small, the solver does not end with "optimal", or the certificate does not hold.
    """
    as_kind("system", system, AugmentedSystem)
    decay, bound = as_strip(decay, bound)
    radius, gap = as_positive("radius", radius), as_positive("gap", gap)
    method = f"{'PD/PI' if derivative else 'PI'}, minimum gamma"

    def attempt(units: Units | None) -> CertifiedGains:
        constraints = pd_pi_constraints(system, None, decay, bound, derivative, units)
        problem = _problem(system, constraints, gap, radius)
        return optimised(method, system, problem, PdPiVariables, None, solver, decay, bound, units)

    return in_some_units(attempt, lambda: even_units(system), solver, _ADVICE_OF_MINIMUM)


def _problem(
    system: AugmentedSystem, constraints: list[Constraint], gap: float, radius: float | None = None
) -> Problem:
    """The problem of all matrices that are in the constraints."""
    size, flat = system.size, (system.outputs, system.size)
    shapes = {
        term.name: flat if term.name.startswith("Y") else (size, size)
        for term in constraints[0].terms
    }
    edges = [above(name, size, _LEAST) for name in ("P1", "P3")]
    return Problem(shapes, frozenset({"P1"}), (*constraints, *edges), gap, radius)
