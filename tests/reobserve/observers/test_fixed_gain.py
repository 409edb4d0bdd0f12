"""Observers of constant gain: poles as placed, the steady Kalman filter, closed forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.observers.fixed_gain import FixedGainObserver, luenberger, steady_kalman
from reobserve.observers.kalman import KalmanFilter
from reobserve.systems.linear import LinearModel
from tests.reobserve.observers.actuator_models import (
    from_rows_on,
    motion_model,
    ripple,
    run_over,
    simulated,
    square_wave,
    velocity_model,
)

Array = NDArray[np.float64]

NORMAL, MOTION = velocity_model("normal"), motion_model("normal")
POLES = [0.9, 0.7, 0.5 + 0.2j, 0.5 - 0.2j]


def relative(found: Array, expected: Array) -> float:
    """The largest error of a column over the largest value of that column."""
    return float(np.max(np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)))


def test_step_is_a_prediction_and_a_correction() -> None:
    u = square_wave(80, 12)
    z = simulated(motion_model("leakage"), u) + ripple(80, 3)
    A, B, C, D, Q, R = MOTION.arrays
    K = steady_kalman(MOTION).gain
    run = run_over(FixedGainObserver(MOTION, gain=K), z, u, np.zeros(5), 1.0)
    x, P, M = np.zeros(5), np.eye(5), np.eye(5) - K @ C
    means, variances = [], []
    for measurement, control, now in zip(z, u, from_rows_on(u), strict=True):
        x, P = A @ x + B @ control, A @ P @ A.T + Q
        x = x + K @ (measurement - C @ x - D @ now)
        P = M @ P @ M.T + K @ R @ K.T
        means.append(x)
        variances.append(np.diag(P))
    assert relative(run["state"], np.array(means)) < 1e-12
    assert relative(run["variance"], np.array(variances)) < 1e-12


def test_error_follows_the_placed_poles() -> None:
    observer = luenberger(NORMAL, POLES)
    assert np.abs(np.sort_complex(observer.poles) - np.sort_complex(POLES)).max() < 1e-9
    # The error satisfies the polynomial of the poles (Cayley-Hamilton).
    u = square_wave(30, 7)
    truth = [np.array([1.0, -2.0, 0.5, 1.0])]
    for k in range(29):
        truth.append(NORMAL.A @ truth[-1] + NORMAL.B @ u[k])
    run = observer.run(np.array(truth) @ NORMAL.C.T, u, start=observer.init(np.zeros(4)))
    error = run["state"] - truth
    coefficients = np.poly(POLES).real[::-1]
    left = [coefficients @ error[k : k + 5] for k in range(25)]
    assert np.abs(left).max() < 1e-9 * np.abs(error).max()
    assert np.abs(error[-1]).max() < 0.2 * np.abs(error[0]).max()


def test_deadbeat_poles_find_the_state_in_n_rows() -> None:
    model = LinearModel([[1.0, 0.1], [0.0, 1.0]], [[0.005], [0.1]], [[1.0, 0.0]], Q=0.0, R=1.0)
    observer, u = luenberger(model, [0.0, 0.0]), np.array([[1.0], [-2.0], [0.5], [0.0]])
    x, truth = np.array([0.3, -1.0]), []
    for control in u:
        truth.append(x)
        x = model.A @ x + model.B @ control
    run = observer.run(np.array(truth)[:, :1], u, start=observer.init([5.0, 5.0]))
    assert run["state"][2:] == pytest.approx(np.array(truth)[2:], abs=1e-11)
    assert np.abs(run["state"][0] - truth[0]).max() > 0.1


def test_steady_filter_equals_kalman_filter_at_steady_covariance() -> None:
    fixed, kalman = steady_kalman(NORMAL), KalmanFilter(NORMAL)
    still = np.zeros((5000, 1))
    settled = kalman.run(still, still, start=kalman.init(np.zeros(4), 1.0)).end.posterior.covariance
    u = square_wave(300, 40)
    z = simulated(NORMAL, u) + 0.01 * ripple(300)
    runs = [run_over(one, z, u, np.zeros(4), settled) for one in (kalman, fixed)]
    for name in ("state", "variance", "innovation"):
        assert relative(runs[0][name], runs[1][name]) < 1e-9
    assert runs[0]["log_likelihood"] == pytest.approx(runs[1]["log_likelihood"], rel=1e-9)


def test_estimates_do_not_depend_on_the_covariance() -> None:
    observer, u = luenberger(NORMAL, POLES), square_wave(50, 7)
    z = simulated(NORMAL, u)
    runs = [observer.run(z, u, start=observer.init(np.zeros(4), *more)) for more in ((), (3.0,))]
    assert np.array_equal(runs[0]["state"], runs[1]["state"])
    assert not np.array_equal(runs[0]["variance"], runs[1]["variance"])
    certain = observer.init(np.zeros(4)).posterior.covariance
    assert np.array_equal(certain, np.zeros((4, 4)))


@pytest.mark.parametrize(
    ("gain", "said"),
    [
        (np.zeros((4, 2)), r"gain: has shape \(4, 2\), must be \(4, 1\)"),
        ([[3.0], [0.0], [0.0], [0.0]], "gain: gives no stable observer: .* it is 2.00001$"),
    ],
)
def test_invalid_gains_are_refused(gain: Any, said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}"):
        FixedGainObserver(NORMAL, gain=gain)


def test_unobservable_or_invalid_model_is_refused() -> None:
    hidden = LinearModel(np.diag([0.5, 0.9]), np.zeros((2, 1)), [[1.0, 0.0]], Q=1.0, R=1.0)
    with pytest.raises(InputError, match=r"^A, C: do not show the mode of the eigenvalue 0.9"):
        luenberger(hidden, [0.1, 0.2])
    with pytest.raises(InputError, match=r"^poles: 1.5 is not inside the unit circle"):
        luenberger(NORMAL, [0.1, 0.2, 0.3, 1.5])
    with pytest.raises(InputError, match=r"^gain: gives no stable observer"):
        FixedGainObserver(NORMAL, gain=10.0 * luenberger(NORMAL, POLES).gain)
    for build in (steady_kalman, lambda model: luenberger(model, POLES)):
        with pytest.raises(InputError, match=r"^model: 3 must be of type LinearModel"):
            build(3)  # type: ignore[arg-type]
