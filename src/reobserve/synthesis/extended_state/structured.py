"""Gains of the PI observer from a Riccati equation, for plants of many states.

The observer is that of Indriawati, Agustinah & Jazidie, (6), for plants that (19) is too large for.

(19) has about 2.5 N^2 unknowns, but it is not they that cost: it is a cone of M rows, with
M = 3 N + kd + kw + r + q, and an interior-point method couples all its M (M + 1) / 2 entries with
each other. Clarabel splits the cone along its blocks, of which the largest keeps 2 N rows: still
2 N^4 numbers to be factored in 2.7 N^6 operations. At N = 28 an iteration takes 0.3 s and 0.2 GB;
N = 104 would take some 30 GB.

A Riccati equation takes the time of one Schur form, N^3. Let Ld = 0, and let a fictitious noise of
weight rho be in the output Y, and one of weight sqrt(eps) in each state. The H-infinity filter

    A~ X + X A~^T + X (I / gamma^2 - C~^T C~ / rho^2) X + Bo Bo^T + eps I = 0,
    L = X C~^T / rho^2,

with the stabilising X > 0 keeps the norm from dD and the noise to e below gamma, thus that from dD.
Nothing in (19) holds down the gains; here rho does, the smaller the faster the observer. It must be
below gamma: otherwise the term in brackets is positive semidefinite, and the equation multiplied by
a fault's unit vector from both sides, where A~ has a row of zeros, is above zero. The choice made
here: of gamma / 2, gamma / 4, ... the largest with a solution, halved once more to keep off the
edge.

P1 = gamma X^-1 solves the bounded real lemma strictly: it turns the inequality into

    gamma^2 X^-1 (-eps I - rho^2 L L^T) X^-1 < 0,

so the design has the same certificate as any other.
"""

from __future__ import annotations

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import Matrix, as_positive
from reobserve.synthesis.extended_state.design import Design, accepted
from reobserve.synthesis.extended_state.floor import as_gamma
from reobserve.synthesis.extended_state.inequality import PiVariables
from reobserve.synthesis.extended_state.system import AugmentedSystem

_EPSILON = 1e-4  # of the largest eigenvalue of Bo Bo^T
_HALVINGS = 30  # of gamma; a noise of 1e-9 gamma means gains beyond 1e9
_HAMILTONIAN = 30  # the largest N whose norm is bounded by Hamiltonian matrices, in a second


def design(
    system: AugmentedSystem,
    factor: float = 1.05,
    gamma: float | None = None,
    noise: float | None = None,
) -> Design:
    """A PI observer with a norm below gamma, by the H-infinity filter's Riccati equation.

    The objective of the design is rho.

    Parameters
    ----------
    system
        The plant.
    factor
        gamma as a multiple of its floor, above one.
    gamma
        The bound of the norm itself, above the floor; it replaces ``factor``.
    noise
        rho, weight of the fictitious noise on Y; found as the module tells if left out.

    Raises
    ------
    InputError
        If gamma is not above the floor, no solution is found, or the certificate does not hold.
    """
    gamma = as_gamma(system, factor, gamma)
    if noise is None:
        rho, X = _search(system, gamma)
    else:
        rho = as_positive("noise", noise)
        found = _stabilising(system, gamma, rho)
        if found is None:
            raise InputError(
                "noise", f"{rho:g} allows no observer with gamma {gamma:.9g}: lower it"
            )
        X = found
    P1 = gamma * np.linalg.inv(X)
    P1 = (P1 + P1.T) / 2.0
    L = X @ system.C_tilde.T / rho**2
    return accepted(
        "PI, Riccati equation",
        system,
        PiVariables(P1, L.T @ P1),
        gamma,
        "Schur form",
        "stabilising",
        rho,
        hamiltonian=system.size <= _HAMILTONIAN,
    )


def _search(system: AugmentedSystem, gamma: float) -> tuple[float, Matrix]:
    """rho and X, one halving beyond the first that has a solution."""
    solved = False
    for halvings in range(1, _HALVINGS):
        rho = gamma / 2.0**halvings
        X = _stabilising(system, gamma, rho)
        if X is not None and solved:
            return rho, X
        solved = X is not None
    raise InputError("gamma", f"{gamma:.9g} is reached by no observer of this kind: raise it")


def _stabilising(system: AugmentedSystem, gamma: float, rho: float) -> Matrix | None:
    """The positive definite X that puts all poles to the left, from the stable Schur vectors."""
    from scipy.linalg import schur

    size, C = system.size, system.C_tilde
    source = system.Bo @ system.Bo.T
    source += _EPSILON * np.linalg.norm(source, 2) * np.eye(size)
    quadratic = C.T @ C / rho**2 - np.eye(size) / gamma**2
    # In a unit of X that makes both blocks off the diagonal alike.
    unit = np.sqrt(np.linalg.norm(source, 2) / np.linalg.norm(quadratic, 2))
    hamiltonian = np.block(
        [[system.A_tilde.T, -unit * quadratic], [-source / unit, -system.A_tilde]]
    )
    try:
        _, vectors, stable = schur(hamiltonian, sort="lhp")
        if stable != size:
            return None
        upper, lower = vectors[:size, :size], vectors[size:, :size]
        X = unit * np.linalg.solve(upper.T, lower.T)
        X = (X + X.T) / 2.0
        np.linalg.cholesky(X)
    except np.linalg.LinAlgError:
        return None
    return np.asarray(X)
