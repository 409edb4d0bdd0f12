"""The Lyapunov function that replaces (13), and the constant of the gyroscopic coupling."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve_papers.papers.ilo.theory_runs import gyroscopic_eta
from tests.reobserve.synthesis.test_ilo_certificate import INERTIA, gyroscopic_difference, simulate

Array = NDArray[np.float64]


def test_one_sided_gyroscopic_constant_bounds_the_coupling() -> None:
    rng = np.random.default_rng(6)
    rate, error = rng.normal(size=(2, 200000, 3))
    rate /= np.linalg.norm(rate, axis=1, keepdims=True)
    error *= 10 ** rng.uniform(-2, 3, (200000, 1))
    power = np.sum(error * gyroscopic_difference(rate, rate - error), axis=1)
    direct = -np.sum(error * np.cross(rate, error @ INERTIA), axis=1)
    scale = np.sum(error**2, axis=1)
    assert np.abs(power - direct).max() < 1e-9 * np.max(scale * np.linalg.norm(error, axis=1))
    eta = gyroscopic_eta(INERTIA, 1.0)
    assert eta == pytest.approx(np.sqrt(9.5**2 + 1.5**2))  # 9.6177
    worst = float(np.max(np.abs(direct) / scale))
    assert 0.98 * eta < worst <= eta


COUPLED = (
    np.diag([12.0, 9.0, 15.0]),
    np.array([[1, 0.2, 0], [0, 1.1, 0], [0.1, 0, 0.9]]),
)


def coupled_gains() -> tuple[Array, Array]:
    """Full gains that satisfy P K2 = B_f^T and K1^T P K1 <= P for a full P."""
    P = np.array([[2.0, 0.3, 0], [0.3, 3.0, 0.1], [0, 0.1, 2.5]]) * 1e-3
    root = np.linalg.cholesky(P).T
    K1 = np.linalg.solve(root, np.array([[0.7, 0.4, 0], [-0.3, 0.8, 0], [0, 0, 0.9]]) @ root)
    return K1, np.linalg.solve(P, COUPLED[1].T)


def repaired_weights(fault_matrix: Array, K1: Array, K2: Array) -> tuple[Array, Array]:
    """P of P K2 = B_f^T and K1^T P K1 <= P, and K1^T P K1 in place of the identity of (13).

    Write x = K1 e(t - tau) and g for the gyroscopic torque difference. Then (4) and (6) are
    J w~' = g + B_f e - Lambda w~ and x = e + K2 w~ - d. With V = w~.J w~ plus the integral of
    e.K1^T P K1 e over the last interval, dV/dt = 2 w~.(g - Lambda w~) + 2 w~.B_f e
    + e.K1^T P K1 e - x.P x. For d = 0, x.P x = e.P e + 2 w~.K2^T P e + w~.K2^T P K2 w~, where
    K2^T P = B_f: the cross terms cancel, and dV/dt = 2 w~.(g - Lambda w~) - w~.B_f K2 w~
    - e.(P - K1^T P K1) e. A mismatch d adds exactly 2 d.(P e + B_f^T w~) - d.P d.
    """
    weight = np.linalg.solve(K2.T, fault_matrix).T
    kept = K1.T @ weight @ K1
    assert np.allclose(weight, weight.T, rtol=1e-9, atol=1e-12)
    assert np.linalg.eigvalsh(weight)[0] > 0
    assert np.linalg.eigvalsh(weight - kept)[0] > -1e-12
    return weight, kept


def lyapunov_values(weight: Array, w: Array, e: Array, samples: int) -> Array:
    """V = w~.J w~ plus the integral of e.``weight`` e over the last interval of 0.05 s."""
    density = quadratic_form(weight, e)
    panels = np.append(0.0, np.cumsum((density[1:] + density[:-1]) / 2))
    learned = (panels[samples:] - panels[:-samples]) * 0.05 / samples
    return np.asarray(quadratic_form(INERTIA, w)[samples:] + learned)


def quadratic_form(matrix: Array, rows: Array) -> Array:
    return np.asarray(np.einsum("ki,ij,kj->k", rows, matrix, rows))


@pytest.mark.parametrize("fault_rate", [0.0, 3.0])
@pytest.mark.parametrize("identity", [True, False])
def test_corrected_derivative_is_exact_at_rest(identity: bool, fault_rate: float) -> None:
    observer_gain, fault_matrix = COUPLED
    K1, K2 = coupled_gains()
    K1 = np.eye(3) if identity else K1
    weight, kept = repaired_weights(fault_matrix, K1, K2)
    w, e, d, _ = simulate(
        observer_gain, fault_matrix, K1, K2, 0.05,
        samples=100, intervals=30, gyroscopic=False, fault_rate=fault_rate,
    )  # fmt: skip
    value = lyapunov_values(kept, w, e, 100)
    decay = quadratic_form(2 * observer_gain + fault_matrix @ K2, w)
    pull = 2 * np.sum(d * (e @ weight + w @ fault_matrix), axis=1) - quadratic_form(weight, d)
    slope = (pull - decay - quadratic_form(weight - kept, e))[100:]
    integral = np.append(0, np.cumsum((slope[1:] + slope[:-1]) / 2)) * 0.05 / 100
    assert value == pytest.approx(value[0] + integral, abs=2e-3 * np.ptp(value))


def test_corrected_function_decreases_where_the_printed_one_rises() -> None:
    observer_gain, K1, K2 = 10 * np.eye(3), np.eye(3), 500 * np.eye(3)
    w, e, _, peak = simulate(
        observer_gain, np.eye(3), K1, K2, 0.05, samples=200, intervals=40, gyroscopic=True
    )
    eta = gyroscopic_eta(INERTIA, peak)
    _, kept = repaired_weights(np.eye(3), K1, K2)
    value = lyapunov_values(kept, w, e, 200)
    assert np.all(value[200::200] < value[:-200:200])
    change = value[1:] - value[:-1]
    assert np.all(change < 0)
    bound = -quadratic_form(2 * observer_gain - 2 * eta * np.eye(3) + K2, w)[200:]
    step = 0.05 / 200
    assert np.all(change <= step * (bound[1:] + bound[:-1]) / 2 + 1e-6 * value[:-1])
    printed = lyapunov_values(np.eye(3), w, e, 200)
    rising = np.mean(np.diff(printed) > 1e-6 * printed[:-1])
    assert 0.2 < rising < 0.8
