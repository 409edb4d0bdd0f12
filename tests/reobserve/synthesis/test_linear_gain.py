"""Placed poles and steady gains: closed forms, eigenvalues, the limit of the filter."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.observers.kalman import KalmanFilter
from reobserve.synthesis.linear_gain import ackermann, place, steady_kalman_gain, unobservable_modes
from reobserve.systems.linear import LinearModel
from tests.reobserve.observers.actuator_models import ACTUATOR, motion_model, velocity_model

Array = NDArray[np.float64]

CHAIN = np.eye(3) + np.eye(3, k=1)


def apart(A: Array, C: Array, gain: Array, poles: Any) -> float:
    """The largest distance between eigenvalues of A - L C and the poles, both sorted."""
    found = np.sort_complex(np.linalg.eigvals(A - gain @ C))
    return float(np.abs(found - np.sort_complex(np.asarray(poles, dtype=complex))).max())


# --- Placement ----------------------------------------------------------------------------------


def test_gain_of_a_double_integrator_agrees_with_closed_form() -> None:
    # s^2 + l1 s + l2 for A - L C.
    gain = place([[0.0, 1.0], [0.0, 0.0]], [[1.0, 0.0]], [-2.0 + 1j, -2.0 - 1j])
    assert gain == pytest.approx(np.array([[4.0], [5.0]]), rel=1e-14)


def test_deadbeat_poles_remove_the_error_in_n_samples() -> None:
    # (1 + (x - 1))^3 = x^3: binomial coefficients for the chain of three in discrete time.
    gain = place(CHAIN, [[1.0, 0.0, 0.0]], [0.0, 0.0, 0.0])
    assert gain == pytest.approx(np.array([[3.0], [3.0], [1.0]]), rel=1e-13)
    left = CHAIN - gain @ [[1.0, 0.0, 0.0]]
    assert np.abs(np.linalg.matrix_power(left, 3)).max() < 1e-12
    assert np.abs(np.linalg.matrix_power(left, 2)).max() > 0.5


@pytest.mark.parametrize("outputs", [1, 2])
@pytest.mark.parametrize(
    "poles", [[0.1, 0.3, 0.5, 0.7], [0.2 + 0.3j, 0.2 - 0.3j, -0.4, 0.9]], ids=["real", "pair"]
)
def test_eigenvalues_are_placed_as_specified(outputs: int, poles: list[complex]) -> None:
    draw = np.random.default_rng(outputs)
    for _ in range(10):
        A, C = draw.normal(size=(4, 4)), draw.normal(size=(outputs, 4))
        assert apart(A, C, place(A, C, poles), poles) < 1e-9


def test_single_output_gain_agrees_with_ackermann() -> None:
    draw = np.random.default_rng(5)
    A, C, poles = draw.normal(size=(4, 4)), draw.normal(size=(1, 4)), np.array([0.1, 0.2, 0.3, 0.4])
    by_formula = ackermann(A.T, C.T, poles.astype(complex)).T
    assert place(A, C, poles) == pytest.approx(by_formula, rel=1e-9)


def test_single_output_may_have_a_double_pole() -> None:
    gain = place([[0.0, 1.0], [0.0, 0.0]], [[1.0, 0.0]], [-3.0, -3.0])
    assert gain == pytest.approx(np.array([[6.0], [9.0]]), rel=1e-13)


def test_two_outputs_may_share_a_pole() -> None:
    draw = np.random.default_rng(7)
    A, C = draw.normal(size=(4, 4)), draw.normal(size=(2, 4))
    gain = place(A, C, [0.5, 0.5, 0.1, 0.1])
    assert np.poly(A - gain @ C) == pytest.approx(np.poly([0.5, 0.5, 0.1, 0.1]), abs=1e-9)


@pytest.mark.parametrize(
    ("A", "C", "poles", "said"),
    [
        (np.diag([0.5, 2.0]), [[1.0, 0.0]], [0.1, 0.2], "A, C: do not show .* eigenvalue 2, which"),
        (np.eye(2), np.eye(1, 2), [0.1, 0.2], "A, C: do not show the mode of the eigenvalue 1, "),
        (np.eye(2), np.eye(2), [0.1], r"poles: \[\(0.1\+0j\)\] must be 2 finite numbers"),
        (np.eye(2), np.eye(2), [0.1, 0.1 + 1j], "poles: .* complex ones in pairs"),
        (CHAIN, np.eye(2, 3), [0.1] * 3, "poles: have one 3 times, at most 2 times is possible"),
        (np.eye(2, 3), np.eye(2), [0.1, 0.2], r"A: has shape \(2, 3\), must be square"),
        (np.eye(2), np.eye(3), [0.1, 0.2], r"C: has shape \(3, 3\), must have 2 columns like A"),
    ],
)
def test_poles_that_cannot_be_placed_are_reported(A: Any, C: Any, poles: Any, said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}"):
        place(A, C, poles)


def test_unobservable_modes_do_not_depend_on_measurement_units() -> None:
    A = np.diag([0.5, 0.9, -0.3])
    for size in (1e-12, 1.0, 1e12):
        found = unobservable_modes(A, size * np.array([[1.0, 0.0, 1.0]]))
        assert found == pytest.approx(np.array([0.9]), rel=1e-14)
    assert len(unobservable_modes(A, np.zeros((1, 3)))) == 3
    assert not len(unobservable_modes(A, np.ones((1, 3))))


# --- The steady gain ----------------------------------------------------------------------------


def scalar(A: float, Q: float, R: float = 1.0) -> LinearModel:
    return LinearModel([[A]], np.empty((1, 0)), [[1.0]], Q=Q, R=R)


def test_steady_gain_of_a_random_walk_agrees_with_closed_form() -> None:
    # P = (q + sqrt(q^2 + 4 q r)) / 2, K = P / (P + r).
    gain = steady_kalman_gain(scalar(1.0, 0.25))
    assert gain == pytest.approx(np.array([[(np.sqrt(17) - 1) / 8]]), rel=1e-12)


def test_steady_gain_without_noise_mirrors_an_unstable_mode() -> None:
    # P = a^2 P r / (P + r): P = (a^2 - 1) r, and the error's pole is 1 / a.
    gain = steady_kalman_gain(scalar(2.0, 0.0))
    assert gain == pytest.approx(np.array([[0.75]]), rel=1e-12)
    assert (1 - gain[0, 0]) * 2.0 == pytest.approx(0.5, rel=1e-12)


@pytest.mark.parametrize("mode", ACTUATOR)
@pytest.mark.parametrize("build", [velocity_model, motion_model])
def test_steady_gain_is_the_limit_of_the_filter_gain(build: Any, mode: str) -> None:
    model = build(mode)
    _, _, H, _, _, R = model.arrays
    kalman, rows = KalmanFilter(model), 4000
    still = np.zeros((rows, model.outputs)), np.zeros((rows, 1))
    run = kalman.run(*still, start=kalman.init(np.zeros(model.states), 1.0))
    P = kalman.predict(run.end.posterior, [0.0]).covariance
    limit = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    found = steady_kalman_gain(model)
    assert np.abs(found - limit).max() < 1e-12 * np.abs(limit).max()


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (
            LinearModel(np.diag([0.5, 1.1]), np.empty((2, 0)), [[1.0, 0.0]], Q=1.0, R=1.0),
            "has an unobservable mode of the eigenvalue 1.1 that does not decay",
        ),
        (
            LinearModel(np.diag([0.5, 1.0]), np.empty((2, 0)), [[1.0, 1.0]], Q=[1.0, 0.0], R=1.0),
            "has a mode of the eigenvalue 1 on the unit circle that Q does not drive",
        ),
    ],
)
def test_missing_steady_gain_is_explained(model: LinearModel, said: str) -> None:
    with pytest.raises(InputError, match=f"^model: {said}"):
        steady_kalman_gain(model)
    # Noise of the rate also moves the position; noise of the position alone does not affect the
    # rate.
    ramp = np.array([[1.0, 1.0], [0.0, 1.0]])
    driven = LinearModel(ramp, np.empty((2, 0)), [[1.0, 0.0]], Q=[0.0, 1.0], R=1.0)
    assert steady_kalman_gain(driven).all()
    with pytest.raises(InputError, match=r"^model: .* on the unit circle that Q does not drive"):
        steady_kalman_gain(replace(driven, Q=[1.0, 0.0]))
    hidden = LinearModel(np.diag([0.5, 0.9]), np.empty((2, 0)), [[1.0, 0.0]], Q=1.0, R=1.0)
    assert steady_kalman_gain(hidden)[1, 0] == pytest.approx(0.0, abs=1e-14)
