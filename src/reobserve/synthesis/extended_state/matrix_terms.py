"""The inequalities of `inequality` as sums of terms L X R of each unknown matrix X.

Let the columns of J1, J2, J3, J4 be the unit vectors of its four blocks. Then (19) asks for S > 0,

    S = gamma (J3 J3^T + J4 J4^T) - J2 J3^T - J3 J2^T + H + H^T,
    H = -J1 P1 (A~ J2^T + Bo J4^T + alpha J1^T) + (J2 - J1) (P2 J1^T + P3 J2^T)
        + J2 C~^T (Y1 J1^T + Y2 J2^T).

The other inequalities follow suit. Certificates do not use this form.
"""

from __future__ import annotations

from math import inf, isfinite

import numpy as np

from reobserve.synthesis.extended_state.central_path import Constraint, MatrixTerm
from reobserve.synthesis.extended_state.system import AugmentedSystem


def pd_pi_constraints(
    system: AugmentedSystem,
    gamma: float | None,
    decay: float = 0.0,
    bound: float = inf,
    derivative: bool = True,
) -> list[Constraint]:
    """The inequality, and the bound of the poles if there is one, with gamma unknown if None.

    Indriawati, Agustinah & Jazidie, (19).

    ``decay`` and ``bound`` [1/s] are alpha and beta. Without ``derivative`` there is no Y2.
    """
    size, inputs = system.Bo.shape
    A, C = system.A_tilde, system.C_tilde
    rows = np.eye(3 * size + inputs)
    J1, J2, J3, J4 = np.split(rows, [size, 2 * size, 3 * size], axis=1)
    slope = J3 @ J3.T + J4 @ J4.T
    constant = -J2 @ J3.T - J3 @ J2.T
    terms = [
        MatrixTerm("P1", -J1, A @ J2.T + system.Bo @ J4.T + decay * J1.T),
        MatrixTerm("P2", J2 - J1, J1.T),
        MatrixTerm("P3", J2 - J1, J2.T),
        MatrixTerm("Y1", J2 @ C.T, J1.T),
        *([MatrixTerm("Y2", J2 @ C.T, J2.T)] if derivative else []),
    ]
    if gamma is None:
        found = [Constraint(constant, tuple(terms), slope)]
    else:
        found = [Constraint(constant + gamma * slope, tuple(terms))]
    if isfinite(bound):
        J1, J2 = np.split(np.eye(2 * size), [size], axis=1)
        terms = [
            MatrixTerm("P1", J1, A @ J2.T + bound * J1.T),
            MatrixTerm("P2", J1 - J2, J1.T),
            MatrixTerm("P3", J2 - J1, J2.T),
            MatrixTerm("Y1", -J2 @ C.T, J1.T),
            *([MatrixTerm("Y2", J2 @ C.T, J2.T)] if derivative else []),
        ]
        found.append(Constraint(np.zeros((2 * size, 2 * size)), tuple(terms)))
    return found


def pi_constraints(system: AugmentedSystem, decay: float) -> list[Constraint]:
    """-P1 Ao - Ao^T P1 - 2 alpha P1, with Y = L^T P1 for L."""
    one = np.eye(system.size)
    terms = (
        MatrixTerm("P1", -one, system.A_tilde),
        MatrixTerm("P1", -decay * one, one),
        MatrixTerm("Y", system.C_tilde.T, one),
    )
    return [Constraint(np.zeros(one.shape), terms)]


def above(name: str, size: int, least: float) -> Constraint:
    """X + X^T >= 2 ``least`` I of the square matrix ``name``."""
    one = np.eye(size)
    return Constraint(-2.0 * least * one, (MatrixTerm(name, one, one),))
