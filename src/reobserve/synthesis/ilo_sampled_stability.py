"""Stability of the learning observer, sampled and held (Chen & Saif 2007, (3) and (4)).

Linearised at rest, see `ilo_error_system`: a linear map from one update to the next.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.core.matrices import Matrix, spectral_radius
from reobserve.synthesis.ilo_error_system import LearningLaw, Verdict


def held_blocks(law: LearningLaw) -> tuple[Matrix, Matrix]:
    """exp(-J^-1 Lambda tau) and the rate error [rad/s] per unit of held estimate, both n x n.

    Raises
    ------
    InputError
        If it is no such law, or one whose errors die out too fast for floats.
    """
    from scipy.linalg import expm

    as_kind("law", law, LearningLaw)
    size = len(law.inertia)
    block = np.zeros((2 * size, 2 * size))
    block[:size, :size] = law.rate_matrix
    block[:size, size:] = np.linalg.solve(law.inertia, law.fault_matrix)
    exponential = np.asarray(expm(block * law.update_interval), dtype=np.float64)
    if not np.isfinite(exponential).all():
        problem = "make error dynamics too fast for floating-point numbers"
        raise InputError("inertia, observer_gain", problem)
    return exponential[:size, :size], exponential[:size, size:]


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused
def sampled_map(
    law: LearningLaw,
) -> Matrix:
    """The map of (rate error at t_k, estimate held before t_k) over one interval, 2n x 2n.

    The estimate v_k = K1 v_{k-1} + K2 (rate error at t_k) is held until t_k + ``interval``; the
    rate error in between is integrated exactly, at rest and without a fault.
    """
    decay, drive = held_blocks(law)
    rates = np.hstack([decay - drive @ law.K2, -drive @ law.K1])
    matrix = np.vstack([rates, np.hstack([law.K2, law.K1])])
    if not np.isfinite(matrix).all():
        raise InputError("K1, K2", "make error dynamics beyond floating-point numbers")
    return matrix


@dataclass(frozen=True)
class SampledStability:
    """Verdict on the sampled-and-held observer, shrinking by ``spectral_radius`` a step."""

    verdict: Verdict
    reason: str
    spectral_radius: float


def sampled_stability(
    law: LearningLaw,
) -> SampledStability:
    """Decide whether the errors of the sampled-and-held observer decay (see `sampled_map`).

    Parameters
    ----------
    law
        See `LearningLaw`; `SampledILO.law` is one.

    Examples
    --------
    >>> from reobserve.synthesis.ilo_sampled_stability import sampled_stability
    >>> from reobserve import RigidBody, SampledILO
    >>> observer = SampledILO(RigidBody([36, 17, 26]), K1=1.0, K2=500.0, observer_gain=500.0,
    ...                       update_interval=0.01, sampling_period=0.01)
    >>> print(sampled_stability(observer.law).verdict)
    stable
    """
    radius = spectral_radius(sampled_map(law))
    verdict: Verdict = "stable" if radius < 1 - 1e-12 else "unstable"
    if abs(radius - 1) <= 1e-12:
        verdict = "marginal"
    reason = f"the map over one interval has spectral radius {radius:.9g}"
    return SampledStability(verdict, reason, radius)


@np.errstate(over="ignore", invalid="ignore")  # what is not finite is refused
def sampled_limit_gain(
    law: LearningLaw,
) -> float:
    """The largest s such that the sampled-and-held observer is stable with s' K2, 0 < s' < s.

    Zero if already small multiples of K2 are not stable, infinity if all multiples are. The map is
    M + s N; where an eigenvalue leaves the unit circle, a product of two eigenvalues is one and
    det[(M + s N) x (M + s N) - I] (Kronecker product) is zero. The positive roots of this quadratic
    eigenvalue problem separate intervals of s in which stability does not change. Leaving the
    circle through a point where the radius only touches one goes unnoticed.

    Parameters
    ----------
    law
        See `LearningLaw`; `SampledILO.law` is one.

    Examples
    --------
    >>> from reobserve.synthesis.ilo_sampled_stability import sampled_limit_gain
    >>> from reobserve import RigidBody, SampledILO
    >>> observer = SampledILO(RigidBody([36, 17, 26]), K1=1.0, K2=500.0, observer_gain=500.0,
    ...                       update_interval=0.01, sampling_period=0.01)
    >>> print(round(sampled_limit_gain(observer.law), 2))
    13.7
    """
    from scipy.linalg import eigvals
    from scipy.optimize import brentq

    decay, drive = held_blocks(law)
    zero = np.zeros_like(decay)
    scale = float(np.linalg.norm(drive, 2))  # [rad/s per N m], makes all blocks of a similar size
    strength = scale * float(np.linalg.norm(law.K2, 2))
    if strength == 0:
        return float("inf") if spectral_radius(law.K1) < 1 else 0.0
    fixed = np.block([[decay, -drive @ law.K1 / scale], [zero, law.K1]])
    learned = np.block([[-drive @ law.K2, zero], [scale * law.K2, zero]]) / strength

    def excess(factor: float) -> float:
        return spectral_radius(fixed + factor * learned) - 1

    eye = np.eye(len(fixed) ** 2)
    constant = np.kron(fixed, fixed) - eye
    linear = np.kron(fixed, learned) + np.kron(learned, fixed)
    left = np.block([[np.zeros_like(eye), eye], [-constant, -linear]])
    right = np.block([[eye, np.zeros_like(eye)], [np.zeros_like(eye), np.kron(learned, learned)]])
    beyond = InputError("K1, K2", "make error dynamics beyond floating-point numbers")
    if not (np.isfinite(left).all() and np.isfinite(right).all()):
        raise beyond
    try:
        factors = np.asarray(eigvals(left, right), dtype=np.complex128)
    except np.linalg.LinAlgError:
        raise beyond from None
    factors = factors[np.isfinite(factors) & (np.abs(factors.imag) < 1e-4 * np.abs(factors))]
    borders = np.unique(factors.real[(factors.real > 1e-9) & (factors.real < 1e9)])
    probes = np.sqrt(np.append(1e-9, borders) * np.append(borders, 1e9))
    if excess(probes[0]) >= 0:
        return 0.0
    for inside, outside in pairwise(probes):
        if excess(outside) >= 0:
            return float(brentq(excess, inside, outside, xtol=1e-13, rtol=1e-13)) / strength
    return float("inf")
