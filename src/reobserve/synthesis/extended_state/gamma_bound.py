"""The attenuation gamma that no gains of the observer can get below, from constant disturbances.

At s = 0 the error (Indriawati, Agustinah & Jazidie, (10)) is G d with Ao G = -Bo; Ld plays no part.
Take the columns of G that belong to da = [d, w], and let K = C~ G be what the observer measures
of them. With L = [Lx; Lf]

    [Aa F] G - Lx K = -Da,    Lf K = 0.

A stable Ao has an inverse, so Lf, of r + q rows, has full rank, and K a rank of p - r - q at most:
constants in a subspace V of dimension k - (p - r - q) or more, k = kd + kw, are not measured. For
them

    [ Aa F ]         [ -Da ]
    [ Ca 0 ] G da =  [  0  ] da,

which fixes G da whatever the gains, as the matrix to the left has full column rank without a zero
at the origin. V lies in the subspace W of those da for which it can be solved at all. Among all
such V in W, the minimum of the largest gain from V is a singular value of G on W (Courant and
Fischer): the one with dim V - 1 smaller ones below it. With as many outputs as faults no constant
is measured, V and W are everything, and the lower bound is the largest singular value of G.
"""

from __future__ import annotations

import numpy as np

from reobserve.core.arguments import as_kind
from reobserve.core.balancing import output_scales, powers
from reobserve.core.errors import InputError
from reobserve.core.matrices import Matrix, as_positive
from reobserve.synthesis.extended_state.system import AugmentedSystem

_NULL = 1e-10  # of the largest singular value: a smaller one counts as zero
_MODERATE = 20.0  # powers of two between the scales of states that are left as they are
_TINIEST, _LARGEST = 1e-150, 1e150  # whose squares are floats


def gamma_lower_bound(system: AugmentedSystem) -> float:
    """A lower bound of the H-infinity norm from dD to e, for all gains that make (10) stable.

    It is zero if there are so many outputs that gains might tell all disturbances from faults.
    """
    inputs = as_kind("system", system, AugmentedSystem).Da.shape[1]
    unseen = inputs - (system.outputs - system.faults)
    if unseen <= 0:
        return 0.0
    states, A, C, Da = system.states + system.outputs, system.A_tilde, system.C_tilde, system.Da
    scales = output_scales(A, C).completed(A).rounded()
    if np.ptp(scales.states) > _MODERATE:
        A, C = scales.transition(A), scales.output(C)
        Da = powers(Da, scales.states[:states, None])
    else:
        scales = scales._replace(states=np.zeros(system.size))
    matrix = np.vstack([A[:states], C])
    right = np.vstack([-Da, np.zeros((system.outputs, inputs))])
    left, values, rows = np.linalg.svd(matrix)
    size = system.size
    misfit = left[:, size:].T @ right
    solvable = _null_space(misfit, float(np.linalg.norm(right, 2)))
    gains = rows.T @ ((left[:, :size].T @ right @ solvable) / values[:, None])
    gains = powers(gains, -scales.states[:, None])
    sizes = np.linalg.svd(gains, compute_uv=False)[::-1]
    return float(sizes[unseen - 1])


def as_gamma(system: AugmentedSystem, factor: float, gamma: float | None = None) -> float:
    """``gamma`` or, if that is none, ``factor`` times the lower bound: above it in any case.

    Raises
    ------
    InputError
        If it is not above the lower bound, or the lower bound is zero and there is no ``gamma``.
    """
    bound = gamma_lower_bound(system)
    if gamma is not None:
        gamma = as_positive("gamma", gamma)
        _check_square("gamma", gamma)
        if gamma <= bound:
            raise InputError(
                "gamma", f"{gamma:.15g} must be above {bound:.15g}, which no gains get below"
            )
        return gamma
    if bound == 0:
        raise InputError("factor", "has no lower bound of gamma to multiply, only zero: give gamma")
    factor = as_positive("factor", factor)
    if factor <= 1:
        raise InputError(
            "factor", f"{factor:g} of the lower bound of gamma, {bound:.15g}, must be above one"
        )
    _check_square("factor", factor * bound)
    return factor * bound


def _check_square(name: str, gamma: float) -> None:
    if not _TINIEST < gamma < _LARGEST:
        raise InputError(name, f"asks for a gamma of {gamma:g}, whose square is no float")


def _null_space(matrix: Matrix, scale: float) -> Matrix:
    """An orthonormal basis of what ``matrix`` takes to zero, in its columns."""
    _, values, rows = np.linalg.svd(matrix)
    return rows[int(np.sum(values > _NULL * scale)) :].T
