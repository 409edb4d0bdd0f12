"""The page for those who come from other libraries: its code, against the peers that are there."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import control as ct
import numpy as np
import pytest
from filterpy.common import van_loan_discretization
from filterpy.kalman import (
    ExtendedKalmanFilter,
    IMMEstimator,
    KalmanFilter,
    MerweScaledSigmaPoints,
    UnscentedKalmanFilter,
)
from numpy.typing import NDArray

from tests.docs.hand_written import PAGES, blocks

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def page() -> Any:
    """The names of the page after its code."""
    names: dict[str, Any] = {}
    for block in blocks(PAGES / "start/coming-from.md"):
        exec(block.text, names)
    return SimpleNamespace(**names)


def close(found: Any, wanted: Any) -> None:
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)


def peer(model: Any) -> Any:
    """filterpy's filter of a model, but for D."""
    made = KalmanFilter(2, 1, 1)
    made.x, made.P = np.zeros((2, 1)), np.eye(2)
    made.F, made.B, made.H, made.Q, made.R = model.A, model.B, model.C, model.Q, model.R
    return made


def left(page: Any) -> Array:
    """y - D u, as columns."""
    found: Array = (page.y - page.u @ page.model.D.T)[:, :, None]
    return found


def test_filter_is_that_of_filterpy_in_either_order(page: Any) -> None:
    z, u = left(page), page.u[:, :, None]
    means, covariances, ahead, _ = peer(page.model).batch_filter(z, us=u, update_first=True)
    close(page.run["state"], means[:, :, 0])
    close(page.run["covariance"], covariances)
    close(page.run["predicted_state"][1:], ahead[:-1, :, 0])
    means, *_ = peer(page.model).batch_filter(z[1:], us=u[:-1])  # us[k] leads to row k
    close(page.predicted_first["state"], means[:, :, 0])
    one = peer(page.model)
    one.update(None)
    assert (one.x == 0).all()


def test_smoother_is_that_of_filterpy_without_an_input(page: Any) -> None:
    means, covariances, *_ = peer(page.model).batch_filter(left(page), update_first=True)
    wanted, spread, *_ = peer(page.model).rts_smoother(means, covariances)
    still = page.kalman.run(left(page)[:, :, 0], 0 * page.u, start=page.start)
    smooth = page.rts_smoother(still)
    close(smooth["state"], wanted[:, :, 0])
    close(smooth["covariance"], spread)
    # With an input it is not the minimum over the record, which is that of the driven rest.
    states, P = page.run["state"][:, :, None], page.run["covariance"]
    undriven, spread, *_ = peer(page.model).rts_smoother(states, P)
    close(page.smooth["covariance"], spread)
    assert np.abs(undriven[:, :, 0] - page.smooth["state"]).max() > 0.05
    driven = [np.zeros(2)]
    for u in page.u[:-1]:
        driven.append(page.model.A @ driven[-1] + page.model.B @ u)
    rest, *_ = peer(page.model).rts_smoother(states - np.array(driven)[:, :, None], P)
    close(page.smooth["state"], rest[:, :, 0] + driven)


def test_estimator_of_control_is_the_prediction(page: Any) -> None:
    m = page.model
    system = ct.ss(m.A, np.hstack([m.B, np.eye(2)]), m.C, np.zeros((1, 3)), 0.1)
    with_noise = {"control_indices": 1, "disturbance_indices": 2}
    made = ct.create_estimator_iosystem(system, m.Q, m.R, np.eye(2), **with_noise)
    time, signals = 0.1 * np.arange(60), np.vstack([left(page)[:, :, 0].T, page.u.T])
    found = ct.input_output_response(made, time, signals, [np.zeros(2), np.eye(2).ravel()])
    close(page.run["predicted_state"], found.outputs.T)
    with pytest.raises(NotImplementedError, match="nonzero 'D'"):
        ct.create_estimator_iosystem(ct.ss(m.A, m.B, m.C, m.D, 0.1), np.eye(1), m.R)
    plain = ct.ss(m.A, m.B, m.C, 0, 0.1)
    own = ct.create_estimator_iosystem(plain, np.eye(1), m.R)
    P0 = ct.lqe(m.A, m.B, m.C, np.eye(1), m.R)[1]  # of x' = A x, with A of discrete time
    found = ct.input_output_response(own, time[:2], signals[:, :2], [np.zeros(2), P0.ravel()])
    gain = m.A @ P0 @ m.C.T / (m.R + m.C @ P0 @ m.C.T)
    close(found.outputs[:, 1], (m.B @ page.u[0] + gain @ left(page)[0, :, 0]))


def test_gains_are_those_of_control(page: Any) -> None:
    m = page.model
    L, P, _ = ct.dlqe(m.A, np.eye(2), m.C, m.Q, m.R)
    close(page.L, L)
    close(page.K, P @ m.C.T / (m.C @ P @ m.C.T + m.R))  # M of kalman and dlqe in MATLAB
    row = ct.place_acker(m.A.T, m.C.T, [0.5, 0.6])
    assert row.shape == row.T.shape == (2,)
    close(page.predictor[:, 0], row)
    close(page.predictor, ct.place(m.A.T, m.C.T, [0.5, 0.6]).T)
    close(np.sort(page.placed.poles), [0.5, 0.6])
    with pytest.raises(ValueError, match="repeated more than rank"):
        ct.place(m.A.T, m.C.T, [0.5, 0.5])
    twice = page.luenberger(m, [0.5, 0.5]).poles
    np.testing.assert_allclose(twice, [0.5, 0.5], atol=1e-7)  # the root of rounding


def test_sampling_is_that_of_control_and_filterpy(page: Any) -> None:
    A, B = [[0, 1], [-4, -0.6]], [[0], [4]]
    sampled = ct.c2d(ct.ss(A, B, [[1, 0]], [[0.1]]), 0.1)
    close(page.model.A, sampled.A)
    close(page.model.B, sampled.B)
    _, Q = van_loan_discretization(np.array(A), np.array([[0], [np.sqrt(0.1)]]), 0.1)
    close(page.model.Q, Q)


def slope(x: Array, u: float) -> Array:
    return np.array([x[1], u - 4 * np.sin(x[0]) - 0.6 * x[1]])


def swung(x: Array, dt: float, u: float) -> Array:
    """A Runge-Kutta step."""
    a = slope(x, u)
    b = slope(x + 0.5 * dt * a, u)
    c = slope(x + 0.5 * dt * b, u)
    d = slope(x + dt * c, u)
    found: Array = x + dt / 6 * (a + 2 * b + 2 * c + d)
    return found


def test_unscented_filter_is_that_of_filterpy(page: Any) -> None:
    points = MerweScaledSigmaPoints(2, 0.5, 2.0, 0.0)
    made = UnscentedKalmanFilter(2, 1, 0.1, lambda x: x[:1], swung, points)
    made.x, made.P = np.zeros(2), np.eye(2)
    made.Q, made.R = page.pendulum.Q, page.pendulum.R
    for k, z in enumerate(page.y):
        made.predict(u=float(page.u[k - 1, 0]) if k else 0.0)
        made.update(z)
        np.testing.assert_allclose(page.swings[1]["state"][k], made.x, rtol=1e-7, atol=1e-9)


def test_extended_filter_is_that_of_filterpy_with_its_own_prediction(page: Any) -> None:
    class Swing(ExtendedKalmanFilter):  # type: ignore[misc]
        def predict_x(self, u: Any = 0) -> None:
            h = 1e-6
            steps = [
                (swung(self.x + h * e, 0.1, u) - swung(self.x - h * e, 0.1, u)) / (2 * h)
                for e in np.eye(2)
            ]
            self.F = np.array(steps).T
            self.x = swung(self.x, 0.1, u)

    made = Swing(2, 1, 1)
    made.x, made.P = np.zeros(2), np.eye(2)
    made.Q, made.R = page.pendulum.Q, page.pendulum.R
    for k, z in enumerate(page.y):
        made.predict(float(page.u[k - 1, 0]) if k else 0.0)
        made.update(z, lambda x: np.array([[1.0, 0.0]]), lambda x: x[:1])
        np.testing.assert_allclose(page.swings[0]["state"][k], made.x, rtol=1e-6, atol=1e-8)


def test_bank_is_that_of_filterpy(page: Any) -> None:
    made = IMMEstimator(
        [peer(page.model), peer(page.loose)], [0.8, 0.2], np.array(page.bank.transition)
    )
    for k, z in enumerate(left(page)):
        made.predict(page.u[k - 1][:, None] if k else np.zeros((1, 1)))
        made.update(z)
        close(page.modes["state"][k], made.x[:, 0])
        close(page.modes["probability"][k], made.mu)
