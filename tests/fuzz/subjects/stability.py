"""Stability and accuracy of learning observers, high gains, floquet exponents, norms and gaps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reobserve.synthesis.floquet import floquet_exponents, limit_cycle
from reobserve.synthesis.h_infinity_norm import h_infinity_norm
from reobserve.synthesis.high_gain import high_gain, high_gain_over_time, lyapunov_matrix
from reobserve.synthesis.ilo_accuracy import (
    error_transfer,
    matched_integrator,
    pi_error_transfer,
    predicted_rms_error,
    sampled_error_transfer,
)
from reobserve.synthesis.ilo_error_system import LearningLaw
from reobserve.synthesis.ilo_lyapunov import RepairedLyapunov, gyroscopic_eta
from reobserve.synthesis.ilo_sampled_stability import (
    held_blocks,
    sampled_limit_gain,
    sampled_map,
    sampled_stability,
    scalar_sampled_limit,
)
from reobserve.synthesis.ilo_stability import continuous_stability, ripple_roots
from reobserve.synthesis.ilo_theorem import bound18, certify, lemma1_sides, theorem1
from reobserve.synthesis.nu_gap import nu_gap

from .models import DENOMINATOR, INERTIA, NUMERATOR, van_der_pol
from .subject import Subject, subject

PARAMETERS = (INERTIA, 500.0, np.eye(3), 0.9, 50.0, 0.01)
LAW = LearningLaw(*PARAMETERS)


def subjects() -> Iterator[Subject]:
    """Calls that must be accepted."""
    yield subject(LearningLaw, *PARAMETERS)
    yield subject(error_transfer, [1.0, 2.0], LAW)
    yield subject(sampled_error_transfer, [1.0, 2.0], LAW)
    yield subject(predicted_rms_error, [[1.0, 0, 0]], [10.0], LAW)
    yield subject(matched_integrator, 500.0, 0.01, 3)
    yield subject(pi_error_transfer, [1.0], INERTIA, 500.0, np.eye(3), 1000.0, 10.0)
    yield subject(gyroscopic_eta, INERTIA, 0.1)
    yield subject(RepairedLyapunov, *PARAMETERS[:-1], 0.01)
    yield subject(held_blocks, LAW)
    yield subject(sampled_map, LAW)
    yield subject(sampled_stability, LAW)
    yield subject(sampled_limit_gain, LAW)
    yield subject(scalar_sampled_limit, 36.0, 500.0, 1.0, 0.01)
    yield subject(continuous_stability, LAW)
    yield subject(ripple_roots, 36.0, 500.0, 0.9, 50.0, 0.01, 3)
    yield from _theorems()
    yield subject(lyapunov_matrix, 3, 2.0)
    yield subject(high_gain, 3, 2.0)
    yield subject(high_gain_over_time, 2, 2.0, np.eye(2), [0.0, 1.0])
    yield subject(h_infinity_norm, [[-1.0]], [[1.0]], [[1.0]], [[0.0]], [[1.0]], 1e-9)
    yield subject(nu_gap, (NUMERATOR, [1.0, *DENOMINATOR]), ([1.0], [1.0, 2.0]))
    forward = type(van_der_pol()).from_expressions(["w", "-a + (1 - a**2)*w"], ["a"], ["a", "w"], 3)
    yield subject(limit_cycle, forward, [2.0, 0.5], 60.0)
    cycle = limit_cycle(forward, [2.0, 0.5], 60.0)
    yield subject(floquet_exponents, cycle, np.tile(-np.eye(2), (400, 1, 1)))


def _theorems() -> Iterator[Subject]:
    zeros = np.zeros((4, 3))
    yield subject(lemma1_sides, zeros, zeros, zeros, 0.9, 50.0, 1.0, 1.0, 1.0)
    yield subject(certify, 500.0, np.eye(3), 0.5, 50.0, 0.01)

    def proved(
        damping: object, faults: object, K1: object, K2: object, eta: object, *rest: object
    ) -> object:
        names = ("gamma1", "gamma2", "gamma3", "gamma4", "rho1")
        return theorem1(damping, faults, K1, K2, eta, **dict(zip(names, rest, strict=True)))  # type: ignore[arg-type]

    weights = (1.0, 1.0, 1.0, 1.0, 0.5)
    yield Subject(
        "synthesis.ilo_theorem.theorem1", proved, (500.0, np.eye(3), 0.5, 50.0, 0.01, *weights)
    )
    theorem = certify(3.0, 1.0, 0.5, 0.5).theorem
    yield subject(bound18, theorem, np.ones((5, 3)), np.ones((5, 3)), 0.1)
