"""The inequalities of `inequality` as sums of terms L X R of each unknown matrix X.

Let the columns of J1, J2, J3, J4 be the unit vectors of its four blocks. Then (19) asks for S > 0,

    S = gamma (J3 J3^T + J4 J4^T) - J2 J3^T - J3 J2^T + H + H^T,
    H = -J1 P1 (A~ J2^T + Bo J4^T + alpha J1^T) + (J2 - J1) (P2 J1^T + P3 J2^T)
        + J2 C~^T (Y1 J1^T + Y2 J2^T).

The other inequalities follow suit. Certificates do not use this form.

In other units T X, S Y and U^-1 dD of states, outputs and disturbances, all diagonal, the matrices
are T A~ T^-1, S C~ T^-1 and T Bo U, and S in these units has the same sign if gamma stands before
J3 T^2 J3^T + J4 U^2 J4^T. P1 = T P1' T, likewise P2 and P3, and Y1 = S Y1' T, Y2 = S Y2' T.
"""

from __future__ import annotations

from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from reobserve.core.balancing import Scales, output_scales, powers
from reobserve.core.matrices import Matrix
from reobserve.synthesis.extended_state.central_path import Constraint, MatrixTerm
from reobserve.synthesis.extended_state.system import AugmentedSystem

_LOOSE = 12.0  # power of two


class Units(NamedTuple):
    """The terms of inequalities: A~, C~, Bo, T^2 and U^2, and the powers of two in T, S."""

    A: Matrix
    C: Matrix
    B: Matrix
    errors: Matrix
    inputs: Matrix
    scales: Scales

    def original(self, matrices: dict[str, Matrix]) -> dict[str, Matrix]:
        """The matrices of the system itself from those in these units."""
        r, s = self.scales.states, self.scales.outputs
        rows = {name: s if name.startswith("Y") else r for name in matrices}
        return {name: powers(each, rows[name][:, None] + r) for name, each in matrices.items()}


def given_units(system: AugmentedSystem) -> Units:
    """The units that the system is given in."""
    size, inputs = system.Bo.shape
    none = Scales(np.zeros(size), np.zeros(system.outputs), 0.0)
    ones = np.ones(size), np.ones(inputs)
    return Units(system.A_tilde, system.C_tilde, system.Bo, *ones, none)


def even_units(system: AugmentedSystem, gamma: float | None = None) -> Units:
    """Units in which what the outputs show of states is of one size, and so are disturbances.

    A unit common to all states makes the least of gamma T^2 and gamma U^2 the same. Where they are
    far above it, errors or disturbances have no part in the norm; less is then asked for, `_LOOSE`,
    which is the stricter inequality.
    """
    A, C = system.A_tilde, system.C_tilde
    scales = output_scales(A, C).completed(A).rounded()
    entering = powers(system.Bo, scales.states[:, None])
    largest = np.abs(entering).max(axis=0)
    inputs = -np.rint(np.log2(np.where(largest > 0, largest, 1.0)))
    common = np.rint((inputs.min() - scales.states.min()) / 2.0)
    scales = Scales(scales.states + common, scales.outputs + common, scales.rate)
    errors, effects = 2.0 * scales.states, 2.0 * (inputs - common)
    loose = errors.min() + _LOOSE if gamma is None else _LOOSE - np.rint(np.log2(gamma))
    return Units(
        scales.transition(A), scales.output(C), powers(entering, inputs),
        np.exp2(np.minimum(errors, loose)), np.exp2(np.minimum(effects, loose)), scales,
    )  # fmt: skip


def pd_pi_constraints(
    system: AugmentedSystem,
    gamma: float | None,
    decay: float = 0.0,
    bound: float = inf,
    derivative: bool = True,
    units: Units | None = None,
) -> list[Constraint]:
    """The inequality, and the bound of the poles if there is one, with gamma unknown if None.

    Indriawati, Agustinah & Jazidie, (19).

    ``decay`` and ``bound`` [1/s] are alpha and beta. Without ``derivative`` there is no Y2. Left
    out, the units are those of the system.
    """
    size, inputs = system.Bo.shape
    units = given_units(system) if units is None else units
    A, C, B = units.A, units.C, units.B
    rows = np.eye(3 * size + inputs)
    J1, J2, J3, J4 = np.split(rows, [size, 2 * size, 3 * size], axis=1)
    slope = (J3 * units.errors) @ J3.T + (J4 * units.inputs) @ J4.T
    constant = -J2 @ J3.T - J3 @ J2.T
    terms = [
        MatrixTerm("P1", -J1, A @ J2.T + B @ J4.T + decay * J1.T),
        MatrixTerm("P2", J2 - J1, J1.T),
        MatrixTerm("P3", J2 - J1, J2.T),
        MatrixTerm("Y1", J2 @ C.T, J1.T),
        *([MatrixTerm("Y2", J2 @ C.T, J2.T)] if derivative else []),
    ]
    if gamma is None:
        constraints = [Constraint(constant, tuple(terms), slope)]
    else:
        constraints = [Constraint(constant + gamma * slope, tuple(terms))]
    if isfinite(bound):
        J1, J2 = np.split(np.eye(2 * size), [size], axis=1)
        terms = [
            MatrixTerm("P1", J1, A @ J2.T + bound * J1.T),
            MatrixTerm("P2", J1 - J2, J1.T),
            MatrixTerm("P3", J2 - J1, J2.T),
            MatrixTerm("Y1", -J2 @ C.T, J1.T),
            *([MatrixTerm("Y2", J2 @ C.T, J2.T)] if derivative else []),
        ]
        constraints.append(Constraint(np.zeros((2 * size, 2 * size)), tuple(terms)))
    return constraints


def pi_constraints(
    system: AugmentedSystem, decay: float, units: Units | None = None
) -> list[Constraint]:
    """-P1 Ao - Ao^T P1 - 2 alpha P1, with Y = L^T P1 for L."""
    units = given_units(system) if units is None else units
    eye = np.eye(system.size)
    terms = (
        MatrixTerm("P1", -eye, units.A),
        MatrixTerm("P1", -decay * eye, eye),
        MatrixTerm("Y", units.C.T, eye),
    )
    return [Constraint(np.zeros(eye.shape), terms)]


def above(name: str, size: int, least: float) -> Constraint:
    """X + X^T >= 2 ``least`` I of the square matrix ``name``."""
    eye = np.eye(size)
    return Constraint(-2.0 * least * eye, (MatrixTerm(name, eye, eye),))
