"""The Lyapunov function that replaces (13), and the constant of the gyroscopic coupling."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve_papers.papers.ilo.lyapunov import (
    gyroscopic_eta,
    lyapunov_values,
    quadratic_form,
    repaired_weights,
)
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
    value = lyapunov_values(INERTIA, kept, w, e, 0.05, 100)
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
    value = lyapunov_values(INERTIA, kept, w, e, 0.05, 200)
    assert np.all(value[200::200] < value[:-200:200])
    change = value[1:] - value[:-1]
    assert np.all(change < 0)
    bound = -quadratic_form(2 * observer_gain - 2 * eta * np.eye(3) + K2, w)[200:]
    step = 0.05 / 200
    assert np.all(change <= step * (bound[1:] + bound[:-1]) / 2 + 1e-6 * value[:-1])
    printed = lyapunov_values(INERTIA, 1.0, w, e, 0.05, 200)
    rising = np.mean(np.diff(printed) > 1e-6 * printed[:-1])
    assert 0.2 < rising < 0.8


def test_corrected_function_needs_its_conditions() -> None:
    repaired_weights(1.0, 1.0 + 1e-14, 500.0)  # a rounding above
    sheared = [[500, 100, 0], [0, 500, 0], [0, 0, 500]]
    for K1, K2, said in (
        (1.0 + 1e-9, 500.0, r"K1: .* must not be below 0"),
        (1.0, -500.0, "K2: .*eigenvalue"),
        (1.0, sheared, "K2: .*symmetric"),
        (1.0, [500, 500, 0], "K2: .*invertible"),
    ):
        with pytest.raises(InputError, match=said):
            repaired_weights(1.0, K1, K2)


LYAPUNOV = "makes a Lyapunov function beyond floating-point numbers"
REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "a tiny K2": (lambda: repaired_weights(1.0, 0.5, 1e-160), f"K2: {LYAPUNOV}"),
    "a K1 of which the square is none": (
        lambda: repaired_weights(1.0, 1e154, 1.0), f"K1: {LYAPUNOV}",
    ),
    "a negative bound": (
        lambda: gyroscopic_eta(np.eye(3), -1e-9), "rate_bound: -1e-09 must not be below zero",
    ),
}  # fmt: skip


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("case", REFUSED)
def test_invalid_numbers_are_refused_naming_the_argument(case: str) -> None:
    call, said = REFUSED[case]
    with pytest.raises(InputError) as error:
        call()
    assert str(error.value).startswith(said)


def test_corrected_function_agrees_with_hand_calculation() -> None:
    """J = 2, B_f = 1, K1 = 1/2, K2 = 4: P = 1/4, and V = 2 w^2 + int e^2 / 16."""
    weight, kept = repaired_weights(1.0, 0.5, 4.0, size=1)
    assert (weight, kept) == (0.25, 1 / 16)
    rate, error = np.array([[1.0], [2.0], [3.0], [4.0]]), np.array([[4.0], [0.0], [8.0], [4.0]])
    # Trapezoids over two steps of 0.5 s: (16 + 2 * 0 + 64) / 4 and (0 + 2 * 64 + 16) / 4.
    expected = [2 * 9 + 20 / 16, 2 * 16 + 36 / 16]
    values = lyapunov_values([[2.0]], kept, rate, error, 1.0, 2)
    np.testing.assert_allclose(values, expected, rtol=1e-14)
    assert lyapunov_values([[2.0]], kept, rate, error, 1.0, 3).shape == (1,)
    for samples in (0, -1, 4, 5):
        with pytest.raises(
            InputError, match=f"samples: {samples} must be a whole number, from 1 to 3"
        ):
            lyapunov_values([[2.0]], kept, rate, error, 1.0, samples)
