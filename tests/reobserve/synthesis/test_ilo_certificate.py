"""Theorem 1 and its errata."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize

from reobserve.core.errors import InputError
from reobserve.synthesis.ilo_accuracy import error_transfer
from reobserve.synthesis.ilo_certificate import Theorem1, _Design, bound18, certify, lemma1_sides
from reobserve.synthesis.ilo_error_system import LearningLaw as Law

Array = NDArray[np.float64]
INERTIA = np.array([[36, 1.5, 0], [1.5, 17, 0], [0, 0, 26.0]])


def evaluated(observer_gain: ArrayLike, fault: float, K1: float, K2: float, eta: float,
              *weights: float) -> Theorem1:  # fmt: skip
    """Theorem 1 for the weights gamma_1..4 and rho_1."""
    return _Design.check(observer_gain, fault, K1, K2, eta).evaluate(*weights)


def test_lemma1_holds_on_random_cases() -> None:
    rng = np.random.default_rng(0)
    tightest = np.inf
    for _ in range(100):
        K1, K2 = rng.normal(size=(2, 3, 3)) * 10 ** rng.uniform(-2, 2, (2, 1, 1))
        weights = 10 ** rng.uniform(-3, 3, 3)
        past, rate, d = rng.normal(size=(3, 2000, 3)) * 10 ** rng.uniform(-2, 2, (3, 2000, 1))
        left, right = lemma1_sides(past, rate, d, K1, K2, *weights)
        assert left.shape == right.shape == (2000,)
        assert np.all(left <= right * (1 + 1e-12))
        tightest = min(tightest, float(np.min(right / left)))
    assert tightest < 1.1  # the bound is attained, so the test is sharp


def test_lemma1_agrees_with_hand_calculation() -> None:
    # x = 2, y = 3, d = 1: (2 - 3 + 1)^2 = 0; alpha = (3, 2 + 1, 1 + 1 + 1).
    left, right = lemma1_sides([[2.0]], [[3.0]], [[1.0]], 1.0, 1.0, 1.0, 1.0, 1.0)
    assert (left[0], right[0]) == (0.0, 3 * 4 + 3 * 9 + 3 * 1)


def test_theorem1_agrees_with_hand_calculation() -> None:
    found = evaluated(10.0, 2.0, 0.5, 0.1, 1.0, 1, 0.5, 2, 4, 0.25)
    factor = 1 + 0.25 + 4 / 4
    assert found.epsilon1 == pytest.approx(20 - 2 - 4 - 4 * factor * 0.01)
    assert found.epsilon2 == pytest.approx(2.5 * factor)
    assert found.epsilon3 == pytest.approx(3.5 * factor)
    assert not found.holds  # 2.5 * 2.25 / 4 > 1
    assert "is above zero and" in found.reason
    assert "1.40625 is above one" in found.reason


def test_identity_learning_is_never_certified() -> None:
    rng = np.random.default_rng(2)
    for weights in 10 ** rng.uniform(-6, 6, (2000, 5)):
        found = evaluated(1e9, 1.0, 1.0, 1e-3, 0.0, *weights)
        assert found.epsilon2 > 1
        assert not found.holds
    assert not certify(1e9, 1.0, 1.0, 1e-3).certified
    assert certify(1e9, 1.0, 1.0, 1e-3).required_observer_gain == np.inf


def smallest_observer_gain(k1: float, k2: float, spread: float) -> float:
    """Infimum of lambda in Theorem 1, by a search over gamma_1 and gamma_4 (others at zero)."""

    def needed(x: Array) -> float:
        gamma1, gamma4 = np.exp(x)
        factor = 1 + spread / gamma4
        if (1 + gamma1) * factor * k1**2 > 1:
            return np.inf
        return float(gamma4 + (1 + 1 / gamma1) * factor * k2**2) / 2

    grid = [np.array([a, b]) for a in np.linspace(-6, 6, 49) for b in np.linspace(-6, 9, 61)]
    start = min(grid, key=needed)
    options = {"xatol": 1e-10, "fatol": 1e-12, "maxiter": 4000, "maxfev": 4000}
    for _ in range(3):
        start = minimize(needed, start, method="Nelder-Mead", options=options).x
    return needed(start)


@pytest.mark.parametrize(
    ("k1", "k2", "fault"), [(0.2, 1.0, 1.0), (0.5, 0.5, 1.0), (0.9, 3.0, 1.0), (0.7, 2.0, 1.5)]
)
def test_required_observer_gain_agrees_with_a_search(k1: float, k2: float, fault: float) -> None:
    found = certify(1.0, fault, k1, k2).required_observer_gain
    assert found == pytest.approx(smallest_observer_gain(k1, k2, fault**2), rel=1e-5)
    above, below = found * 1.0001, found * 0.9999
    assert certify(above, fault, k1, k2).certified
    assert not certify(below, fault, k1, k2).certified
    assert certify(above + 7, fault, k1, k2, eta=7.0).certified
    assert not certify(below + 7, fault, k1, k2, eta=7.0).certified


def test_infimum_of_the_certified_ratio_is_one() -> None:
    # lambda (1 - k1) / k2 over all certified scalar designs, as a function of k2: above one,
    # and one at k2 = k1.
    for k1 in (0.2, 0.5, 0.9, 0.99):
        gains = k1 * np.append(np.geomspace(0.01, 100, 41), 1.0)
        ratios = [certify(1.0, 1.0, k1, k2).required_observer_gain * (1 - k1) / k2 for k2 in gains]
        assert min(ratios) == pytest.approx(1, abs=1e-12)
        assert ratios[-1] == pytest.approx(1, abs=1e-12)
    barely = certify(1.0001, 1.0, 0.5, 0.5)
    assert barely.certified
    assert 0.5 < barely.dc_error < 0.5001
    assert barely.dc_error == pytest.approx(1.0001 * 0.5 / (1.0001 * 0.5 + 0.5))


def test_error_of_certified_designs_exceeds_half_of_any_sinusoid() -> None:
    rng = np.random.default_rng(4)
    for _ in range(40):
        K1 = rng.normal(size=(3, 3))
        K1 *= rng.uniform(0.1, 0.98) / np.linalg.norm(K1, 2)
        K2 = rng.normal(size=(3, 3)) * 10 ** rng.uniform(-2, 2)
        fault = rng.normal(size=(3, 3))
        observer_gain = certify(1.0, fault, K1, K2).required_observer_gain * 1.001
        design = certify(observer_gain, fault, K1, K2)
        assert design.certified
        assert design.theorem is not None
        assert design.theorem.holds
        omega = np.append(0.0, np.geomspace(1e-3, 1e4, 60))
        transfer = error_transfer(omega, Law(INERTIA, observer_gain, fault, K1, K2, 0.01))
        assert np.linalg.norm(transfer, -2, axis=(1, 2)).min() > 0.5
        assert np.linalg.norm(transfer[0], 2) == pytest.approx(design.dc_error, rel=1e-9)


def test_certified_error_bound_is_at_least_the_fault() -> None:
    # Assumption 1 alone gives |u_f| <= k_d / (1 - k1): the error of an estimate that stays zero.
    for k1, k2 in [(0.1, 0.1), (0.5, 0.5), (0.9, 1.0), (0.9, 20.0)]:
        for factor in (1.01, 2.0, 1e3, 1e6):
            observer_gain = factor * certify(1.0, 1.0, k1, k2).required_observer_gain
            design = certify(observer_gain, 1.0, k1, k2)
            assert design.theorem is not None
            assert design.theorem.holds
            assert design.theorem.epsilon3 > design.theorem.rho1 / (1 - k1) ** 2
            assert f"no RMS error below {1 / (1 - k1):.4g} k_d" in design.reason
    # A large Lambda, negligible rate weights and gamma_2 = 1 / k1 - 1 come close to it.
    k1, tiny = 0.9, 1e-6
    gamma2, huge = 1 / k1 - 1, 1e12
    rho1 = 1 / (k1**2 * (1 + tiny + gamma2)) - 1 - 1 / huge
    found = evaluated(1e30, 1.0, k1, 1.0, 0.0, tiny, gamma2, huge, huge, rho1 * (1 - 1e-9))
    assert found.holds
    assert np.sqrt(found.epsilon3 / found.rho1) == pytest.approx(1 / (1 - k1), rel=1e-4)


def test_sign_of_the_correction_does_not_enter_the_certificate() -> None:
    K2 = np.array([[0.5, 0.1, 0], [0, 0.4, 0], [0, -0.1, 0.3]])
    plus, minus = (certify(40.0, 1.0, 0.5, sign * K2) for sign in (1, -1))
    assert plus.certified
    assert (plus.weights, plus.theorem) == (minus.weights, minus.theorem)


def test_accurate_certified_designs_need_an_extreme_observer_gain() -> None:
    design = certify(100.0, 1.0, 0.9, 2000.0)
    assert not design.certified
    assert design.dc_error == pytest.approx(10 / 2010)
    # 2 lambda (1 - k1^2) = k1^2 + 2 k2 + k2^2
    assert design.required_observer_gain == pytest.approx((0.81 + 4000 + 4e6) / (2 * 0.19))


def test_inequality_16_with_the_printed_sign_is_violated() -> None:
    # w~ = 0, e(t - tau) = 0 and e = d: the derivative of (13) is e.e = d.d.
    d = np.array([1.0, 0.0, 0.0])
    design = certify(100.0, 1.0, 0.5, 1.0)
    assert design.theorem is not None
    assert design.weights is not None
    derivative = d @ d
    decay = -design.theorem.rho1 * (d @ d)
    assert derivative > decay - design.theorem.epsilon3 * (d @ d)
    assert derivative <= decay + design.theorem.epsilon3 * (d @ d)


def gyroscopic_difference(rate: Array, estimate: Array) -> Array:
    return np.cross(estimate, estimate @ INERTIA) - np.cross(rate, rate @ INERTIA)


def test_assumption_2_fails_globally() -> None:
    rate, ratios = np.array([0.05, -0.03, 0.04]), []
    for size in (1.0, 1e2, 1e4):
        estimate = rate - size * np.array([1.0, 1.0, 0.0])
        difference = gyroscopic_difference(rate, estimate)
        ratios.append(np.linalg.norm(difference) / np.linalg.norm(rate - estimate))
    assert ratios[2] > 90 * ratios[1] > 8000 * ratios[0] > 0


def simulate(
    observer_gain: Array,
    fault_matrix: Array,
    K1: Array,
    K2: Array,
    interval: float,
    *,
    samples: int,
    intervals: int,
    gyroscopic: bool,
    fault_rate: float = 0.0,
) -> tuple[Array, Array, Array, float]:
    """w~, e and d on a uniform grid from t = -tau, by Heun's method; and max |w|.

    The history of e is a straight line that ends where the learning law starts, so that e is
    continuous. The fault is u_f = U sin(fault_rate t) + U.
    """
    h, n = interval / samples, len(K1)
    steps = samples * intervals
    time = h * np.arange(-2 * samples, steps + 1)
    fault = np.outer(1 + np.sin(fault_rate * time), np.array([0.5, -0.2, 0.3])[:n])
    d = np.zeros_like(fault)
    d[samples:] = fault[samples:] - fault[:-samples] @ K1.T
    inverse = np.linalg.inv(INERTIA[:n, :n])
    w_error = np.zeros((len(time), n))
    error = np.zeros((len(time), n))
    origin = 2 * samples
    w_error[origin] = np.array([0.02, -0.01, 0.03])[:n]
    first, jump = np.array([0.4, 0.1, -0.3])[:n], d[origin] - K2 @ w_error[origin]
    last = K1 @ first + jump
    fraction = np.linspace(0, 1, samples + 1)[:, None]
    error[samples : origin + 1] = first + fraction * (last - first)
    rate, peak = np.array([0.3, -0.5, 0.4]), 0.0

    def slopes(rate: Array, w: Array, e: Array) -> tuple[Array, Array]:
        turn = gyroscopic_difference(rate, rate - w) if gyroscopic else np.zeros(n)
        acceleration = -np.cross(rate, INERTIA @ rate) if gyroscopic else np.zeros(3)
        return np.linalg.solve(INERTIA, acceleration), inverse @ (
            turn + fault_matrix @ e - observer_gain @ w
        )

    for k in range(origin, len(time) - 1):
        peak = max(peak, float(np.linalg.norm(rate)))
        known = K1 @ error[k + 1 - samples] + d[k + 1]
        a1, b1 = slopes(rate, w_error[k], error[k])
        guess = w_error[k] + h * b1
        a2, b2 = slopes(rate + h * a1, guess, known - K2 @ guess)
        rate = rate + h / 2 * (a1 + a2)
        w_error[k + 1] = w_error[k] + h / 2 * (b1 + b2)
        error[k + 1] = known - K2 @ w_error[k + 1]
    return w_error[samples:], error[samples:], d[samples:], peak


@pytest.mark.parametrize("size", [0.0, 5e-324, 1e-170])
def test_fault_without_effect_is_refused(size: float) -> None:
    with pytest.raises(InputError, match=r"^fault_matrix: must not be zero, nor so small"):
        certify(5e14, np.full((3, 3), size), 0.5, 50.0)


def test_bound18_holds_and_is_loose_on_a_certified_design() -> None:
    k1, k2, observer_gain = 0.5, 0.5, 3.0
    design = certify(observer_gain, 1.0, k1, k2)
    assert design.theorem is not None
    gains = (observer_gain * np.eye(3), np.eye(3), k1 * np.eye(3), k2 * np.eye(3))
    w, e, d, _ = simulate(*gains, 0.1, samples=20, intervals=400, gyroscopic=False, fault_rate=2.0)
    k_d = float(np.linalg.norm(d, axis=1).max())
    energy = float(w[20] @ INERTIA @ w[20] + np.sum(e[:20] ** 2) * 0.1 / 20)
    left, right = bound18(design.theorem, w[20:], e[20:], k_d)
    assert right + energy / 40.0 > 5 * left
    # The promised RMS error is above the largest fault, 2 |U|.
    promised = np.sqrt(design.theorem.epsilon3 / design.theorem.rho1) * k_d
    assert promised > 2 * np.linalg.norm([0.5, -0.2, 0.3])
    uncertified = evaluated(1.0, 1.0, 1.0, 1.0, 0.0, 1, 1, 1, 1, 1)
    with pytest.raises(InputError, match="conditions"):
        bound18(uncertified, w, e, k_d)


def test_observer_gain_enters_by_its_symmetric_part() -> None:
    """x^T Lambda x does not depend on the antisymmetric part: lambda_min is 10 for any of its
    sizes.
    """
    weights = 1.0, 0.5, 2.0, 4.0, 0.25
    turned = 10 * np.eye(3) + 7 * np.array([[0, 1, -2], [-1, 0, 3], [2, -3, 0.0]])
    found = evaluated(turned, 2.0, 0.5, 0.1, 1.0, *weights)
    assert found == evaluated(10.0, 2.0, 0.5, 0.1, 1.0, *weights)
    # With [[2, 4], [0, 2]] in a corner the symmetric part has the eigenvalue 2 - 2.
    sheared = 10 * np.eye(3)
    sheared[:2, :2] = [[2, 4], [0, 2]]
    none = evaluated(sheared, 2.0, 0.5, 0.1, 0.0, *weights)
    assert none.epsilon1 == pytest.approx(0 - 4 - 4 * (1 + 0.25 + 4 / 4) * 0.01)


@settings(max_examples=150, deadline=None)
@given(
    observer_gain=st.floats(-10.0, 149.0), fault=st.floats(-165.0, 149.0),
    K1=st.floats(0.0, 1.0), K2=st.floats(-200.0, 149.0),
)  # fmt: skip
@example(observer_gain=0.0, fault=-160.0, K1=0.0, K2=-172.0)
@example(observer_gain=0.0, fault=-145.0, K1=1e-8, K2=-170.0)
def test_designs_of_any_size_are_decided_or_refused(
    observer_gain: float, fault: float, K1: float, K2: float
) -> None:
    """Gains are powers of ten; the norm of K1 is below one, at most."""
    try:
        found = certify(10.0**observer_gain, 10.0**fault, K1, 10.0**K2)
    except InputError:
        return
    assert not np.isnan(found.required_observer_gain)
    assert found.certified == (found.weights is not None)
