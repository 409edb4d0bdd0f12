"""Stability results against closed forms, root searches, discretisation and iteration."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import eigvals
from scipy.optimize import root

from reobserve.core.errors import InputError
from reobserve.synthesis.ilo_error_system import LearningLaw as Law
from reobserve.synthesis.ilo_sampled_stability import (
    sampled_limit_gain,
    sampled_map,
    sampled_stability,
)
from reobserve.synthesis.ilo_stability import continuous_stability

Array = NDArray[np.float64]
INERTIA = np.array([[36, 1.5, 0], [1.5, 17, 0], [0, 0, 26.0]])
SMALLEST = 26.5 - np.sqrt(9.5**2 + 1.5**2)  # eigenvalue of INERTIA, by hand


def delay_roots(observer_gain: Array, K1: Array, K2: Array, interval: float, nodes: int) -> Array:
    """Characteristic roots of the delay system with B_f = I, by collocation in the delay.

    The unknowns are w~ and the history of v on Chebyshev points of [-tau, 0]. The history is
    transported; v(0) = K1 v(-tau) + K2 w~ is algebraic, so the eigenvalue problem is generalised.
    """
    n = len(K1)
    theta = np.cos(np.pi * np.arange(nodes + 1) / nodes)
    c = np.where(np.isin(np.arange(nodes + 1), (0, nodes)), 2.0, 1.0) * (-1.0) ** np.arange(
        nodes + 1
    )
    gap = theta[:, None] - theta + np.eye(nodes + 1)
    D = np.outer(c, 1 / c) / gap
    D -= np.diag(D.sum(axis=1))
    size = n * (nodes + 2)
    left, right = np.zeros((size, size)), np.eye(size)
    left[:n, :n] = -np.linalg.solve(INERTIA[:n, :n], observer_gain)
    left[:n, n : 2 * n] = -np.linalg.inv(INERTIA[:n, :n])
    left[n:, n:] = np.kron(D * 2 / interval, np.eye(n))
    # Row of theta = 1 (now): 0 = -v(0) + K1 v(-tau) + K2 w~.
    left[n : 2 * n] = 0
    left[n : 2 * n, :n] = K2
    left[n : 2 * n, n : 2 * n] = -np.eye(n)
    left[n : 2 * n, -n:] = K1
    right[n : 2 * n] = 0
    values = eigvals(left, right)
    return np.asarray(values[np.isfinite(values)])


def rightmost(observer_gain: Array, K1: Array, K2: Array, interval: float) -> float:
    """The largest real part of a root that two collocations agree on."""
    coarse = delay_roots(observer_gain, K1, K2, interval, 40)
    fine = delay_roots(observer_gain, K1, K2, interval, 56)
    near = np.min(np.abs(coarse[:, None] - fine), axis=1) < 1e-6 * (1 + np.abs(coarse))
    return float(np.max(coarse[near].real))


def test_learning_gain_above_one_diverges_at_the_rate_of_its_logarithm() -> None:
    verdict = continuous_stability(Law(INERTIA, 100.0, 1.0, 1.05, 2000.0, 0.01))
    assert verdict.verdict == "unstable"
    assert verdict.growth_rate == pytest.approx(np.log(1.05) / 0.01, rel=1e-12)
    # A root of the scalar equation at high frequency has that growth rate.
    start = np.array([np.log(1.05) / 0.01, 2 * np.pi * 3000 / 0.01])

    def equation(x: Array) -> list[float]:
        s = complex(*x)
        value = 1 - 1.05 * np.exp(-0.01 * s) + 2000 / (36 * s + 100)
        return [value.real, value.imag]

    found = root(equation, start, tol=1e-12)
    assert found.success
    assert found.x[0] == pytest.approx(verdict.growth_rate, abs=1e-4)


def test_any_positive_scalar_learning_gain_is_stable() -> None:
    rng = np.random.default_rng(1)
    for _ in range(150):
        k1, (k2, observer_gain, interval) = rng.uniform(-0.99, 0.99), 10 ** rng.uniform(-3, 5, 3)
        verdict = continuous_stability(Law(INERTIA, observer_gain, 1.0, k1, k2, interval * 1e-3))
        assert verdict.verdict == "stable", (k1, k2, observer_gain, interval, verdict)


@pytest.mark.parametrize("K2", [1.0, 2000.0, 1e6])
def test_identity_learning_gain_is_marginal(K2: float) -> None:
    verdict = continuous_stability(Law(INERTIA, 100.0, 1.0, 1.0, K2, 0.01))
    assert verdict.verdict == "marginal"
    assert verdict.unstable_roots == 0
    assert verdict.worst_round_gain == pytest.approx(1.0, abs=1e-9)


def test_negative_learning_gain_beyond_the_observer_gain_is_unstable() -> None:
    # At s = 0 the scalar function is lambda (1 - k1) + k2: a real root crosses at k2 = -10.
    for k2, expected in [(-9.9, "stable"), (-10.1, "unstable"), (-500.0, "unstable")]:
        verdict = continuous_stability(Law(36.0, 100.0, 1.0, 0.9, k2, 0.01))
        assert verdict.verdict == expected, verdict.reason
    assert continuous_stability(Law(INERTIA, 100.0, 1.0, 0.9, -500.0, 0.01)).unstable_roots == 3
    assert continuous_stability(Law(INERTIA, 100.0, 1.0, 1.0, -1.0, 0.01)).verdict == "unstable"


def test_matrix_gains_agree_with_collocation() -> None:
    rng = np.random.default_rng(7)
    seen = {"stable": 0, "unstable": 0, "counted stable": 0}
    for _ in range(90):
        interval = 10 ** rng.uniform(-1.5, -0.5)
        observer_gain = np.diag(rng.uniform(20, 200, 3))
        K1 = rng.normal(size=(3, 3))
        K1 *= rng.uniform(0.2, 0.9) / np.max(np.abs(np.linalg.eigvals(K1)))
        K2 = rng.normal(size=(3, 3)) * rng.uniform(50, 600) + np.eye(3) * rng.uniform(0, 600)
        reference = rightmost(observer_gain, K1, K2, interval)
        if abs(reference) * interval < 2e-3:
            continue
        verdict = continuous_stability(Law(INERTIA, observer_gain, 1.0, K1, K2, interval))
        assert verdict.verdict == ("unstable" if reference > 0 else "stable"), verdict.reason
        if verdict.verdict == "unstable" and verdict.growth_rate is not None:
            assert verdict.growth_rate <= reference + 1e-6
        seen[verdict.verdict] += 1
        seen["counted stable"] += verdict.verdict == "stable" and verdict.worst_round_gain > 1
    assert min(seen.values()) >= 3, seen


def test_count_of_roots_agrees_with_collocation() -> None:
    rng = np.random.default_rng(3)
    counted = 0
    for _ in range(30):
        K1, K2 = 0.3 * rng.normal(size=(3, 3)), 800 * rng.normal(size=(3, 3))
        verdict = continuous_stability(Law(INERTIA, 50.0, 1.0, K1, K2, 0.05))
        if not verdict.unstable_roots or verdict.counted_right_of is None:
            continue
        roots = delay_roots(50 * np.eye(3), K1, K2, 0.05, 60)
        beyond = roots[roots.real > verdict.counted_right_of]
        assert verdict.unstable_roots == len(beyond)
        assert verdict.search_radius is not None
        assert np.all(np.abs(beyond) < verdict.search_radius)
        counted += 1
    assert counted >= 5


def test_gain_rotating_the_harmonics_is_unstable_with_identity_learning() -> None:
    turn = np.array([[1.0, 0.05], [-0.05, 1.0]])  # complex eigenvalues close to the real axis
    verdict = continuous_stability(Law(np.eye(2), 1.0, 1.0, 1.0, 30 * turn, 0.1))
    assert verdict.verdict == "unstable"
    # Each eigenvalue k of K2 is a scalar problem; follow one of its ripple roots.
    k, s = 30 * (1 + 0.05j), 2j * np.pi * 20 / 0.1
    for _ in range(200):
        s = (2j * np.pi * 20 - np.log(1 + k / (s + 1))) / 0.1
    other = 2j * np.pi * 20 / 0.1
    for _ in range(200):
        other = (2j * np.pi * 20 - np.log(1 + k.conjugate() / (other + 1))) / 0.1
    assert max(s.real, other.real) > 0


@pytest.mark.parametrize("coupling", [1.0, 3.2e-4])
def test_defective_learning_gain_is_unstable(coupling: float) -> None:
    K1 = np.array([[1, coupling, 0], [0, 1, 0], [0, 0, 0.5]])
    verdict = continuous_stability(Law(INERTIA, 100.0, 1.0, K1, 100.0, 0.01))
    assert verdict.verdict == "unstable"
    assert "defective" in verdict.reason


LIMITS = [
    (0.1, 1.0, 675.29),
    (0.01, 1.0, 6752.92),
    (0.001, 1.0, 67529.2),
    (0.1, 0.9, 641.5),
    (0.01, 0.9, 6415.3),
    (0.001, 0.9, 64152.8),
]


@pytest.mark.parametrize(("interval", "K1", "expected"), LIMITS)
def test_sampled_limit_for_the_satellite_agrees_with_the_scalar_formula(
    interval: float, K1: float, expected: float
) -> None:
    limit = sampled_limit_gain(Law(INERTIA, 1.0, 1.0, K1, 1.0, interval))
    assert limit == pytest.approx(expected, rel=2e-4 if K1 < 1 else 1e-5)


def test_sampled_limit_agrees_with_closed_form() -> None:
    rng = np.random.default_rng(5)
    for _ in range(60):
        observer_gain, interval, unit = 10 ** rng.uniform((-1, -3, -2), (3, 0, 4))
        K1 = rng.uniform(-0.9, 1.0)
        limit = sampled_limit_gain(Law(INERTIA, observer_gain, 1.0, K1, unit, interval)) * unit
        a = np.exp(-observer_gain * interval / SMALLEST)
        expected = (1 + a) * (1 + K1) * observer_gain / (1 - a)
        assert limit == pytest.approx(expected, rel=1e-9), (observer_gain, interval, K1)


def iterate(
    inertia: Array, observer_gain: Array, K1: Array, K2: Array, interval: float, n: int
) -> float:
    """Growth of the sampled observer's error over ``n`` intervals, by fine Runge-Kutta steps."""
    rng = np.random.default_rng(11)
    w, v = rng.normal(size=len(K1)), np.zeros(len(K1))
    A, fine = -np.linalg.solve(inertia, observer_gain), 8
    h = interval / fine
    step = np.eye(len(A)) + sum(
        np.linalg.matrix_power(A * h, k) / np.prod(np.arange(1.0, k + 1)) for k in range(1, 5)
    )
    peaks = []
    for _ in range(n):
        v = K1 @ v + K2 @ w
        for _ in range(fine):
            rest = np.linalg.solve(
                observer_gain, v
            )  # equilibrium of the held estimate: -Lambda^-1 v
            w = step @ (w + rest) - rest
        peaks.append(np.linalg.norm(w))
    return float(np.max(peaks[-n // 20 :]) / np.max(peaks[: n // 20]))


def test_sampled_limit_agrees_with_iteration_for_matrix_gains() -> None:
    rng = np.random.default_rng(13)
    checked = 0
    for _ in range(14):
        observer_gain = np.diag(rng.uniform(20, 300, 3))
        K1 = 0.3 * rng.normal(size=(3, 3))
        K2 = 100 * np.eye(3) + 30 * rng.normal(size=(3, 3))
        limit = sampled_limit_gain(Law(INERTIA, observer_gain, 1.0, K1, K2, 0.1))
        if limit in (0.0, np.inf):
            continue
        for factor, grows in [(0.97, False), (1.03, True)]:
            growth = iterate(INERTIA, observer_gain, K1, factor * limit * K2, 0.1, 600)
            assert (growth > 1) == grows, (factor, growth)
            verdict = sampled_stability(
                Law(INERTIA, observer_gain, 1.0, K1, factor * limit * K2, 0.1)
            )
            assert verdict.verdict == ("unstable" if grows else "stable")
        for fraction in np.linspace(0.01, 0.99, 50):
            gain = fraction * limit * K2
            assert (
                sampled_stability(Law(INERTIA, observer_gain, 1.0, K1, gain, 0.1)).verdict
                == "stable"
            )
        edge = sampled_stability(Law(INERTIA, observer_gain, 1.0, K1, limit * K2, 0.1))
        assert edge.spectral_radius == pytest.approx(1, abs=1e-9)
        checked += 1
    assert checked >= 8


def test_sampled_limit_may_be_infinite_or_zero() -> None:
    assert sampled_limit_gain(Law(INERTIA, 100.0, 1.0, 0.9, 0.0, 0.1)) == np.inf
    assert sampled_limit_gain(Law(INERTIA, 100.0, 1.0, 1.0, 0.0, 0.1)) == 0
    assert sampled_limit_gain(Law(INERTIA, 100.0, 1.0, 1.0, -1.0, 0.1)) == 0
    assert sampled_limit_gain(Law(INERTIA, 100.0, 1.0, 1.05, 1.0, 0.1)) == 0
    # A nilpotent feedback cannot move an eigenvalue.
    assert sampled_limit_gain(Law(np.eye(2), 1.0, 1.0, 0.5, [[0, 1], [0, 0]], 0.1)) == np.inf
    # For small negative gains lambda (1 - k1) + k2 = 0 is the crossing, as in continuous time.
    assert sampled_limit_gain(Law(36.0, 100.0, 1.0, 0.9, -1.0, 0.1)) == pytest.approx(10, rel=1e-9)


def test_sampled_limit_is_the_first_of_several() -> None:
    """At z = 1, det[(I - K1) D + s K2] = (1.8 - s)(2.6 - s): a pole leaves there and returns."""
    observer_gain, K1 = np.diag([3.0, 5.2]), np.array([[1.0, 0.5], [-0.6, -0.9]])
    K2 = np.array([[0.0, 1.0], [-1.0, -1.0]])
    law = (np.eye(2), observer_gain, 1.0, K1)
    assert sampled_limit_gain(Law(*law, K2, 0.1)) == pytest.approx(1.8, rel=1e-9)
    found = [
        sampled_stability(Law(*law, s * K2, 0.1)).verdict for s in (1.7, 1.9, 2.5, 2.7, 3.8, 3.9)
    ]
    assert found == ["stable", "unstable", "unstable", "stable", "stable", "unstable"]


def test_determinant_of_the_sampled_map_equals_that_of_the_rate_dynamics() -> None:
    a = np.exp(-0.5 * 0.1 / 36)
    step = sampled_map(Law(36.0, 0.5, 1.0, 1.0, 40.0, 0.1))
    assert np.linalg.det(step) == pytest.approx(a, rel=1e-12)


def test_invalid_parameters_are_named() -> None:
    with pytest.raises(InputError, match="observer_gain"):
        continuous_stability(Law(INERTIA, 0.0, 1.0, 1.0, 1.0, 0.1))
    with pytest.raises(InputError, match="interval"):
        sampled_stability(Law(INERTIA, 1.0, 1.0, 1.0, 1.0, 0.0))
