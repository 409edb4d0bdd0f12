"""Filters on nonlinear models against filterpy, 50 digits, linear filters and published
examples."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter as PeerEKF
from filterpy.kalman import MerweScaledSigmaPoints
from filterpy.kalman import UnscentedKalmanFilter as PeerUKF
from mpmath import mp
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reobserve import (
    IMM,
    ExtendedKalmanFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    UnscentedKalmanFilter,
)

Array = NDArray[np.float64]

A = np.array([[1.0, 0.1], [-0.2, 0.9]])
B, C, D = np.array([[0.0], [0.1]]), np.array([[1.0, 0.0]]), np.array([[0.5]])
Q, R = np.diag([1e-3, 1e-2]), np.array([[0.1]])
SHARED = ("state", "variance", "innovation", "log_likelihood")


def linear_as_text(gain: float = 1.0) -> NonlinearModel:
    """The linear model, written as texts."""
    return NonlinearModel(
        ["a + w/10", "-a/5 + 0.9*w + gain*u/10"], "a + u/2", Q, R, state_names=["a", "w"],
        input_names=["u"], parameters={"gain": gain},
    )  # fmt: skip


def record(rows: int = 200, seed: int = 1) -> tuple[Array, Array]:
    """Measurements with gaps, and inputs."""
    rng = np.random.default_rng(seed)
    y, u = np.cumsum(rng.normal(size=(rows, 1)), axis=0), rng.normal(size=(rows, 1))
    y[5], y[60:70] = np.nan, np.nan
    return y, u


def test_three_filters_agree_on_a_linear_model() -> None:
    y, u = record()
    kalman = KalmanFilter(LinearModel(A, B, C, D, Q=Q, R=R))
    wanted = kalman.run(y, u, start=kalman.init([1.0, 0.0], 1.0))
    models = linear_as_text(), NonlinearModel(
        lambda x, u: A @ x + B @ u, lambda x, u: C @ x + D @ u, Q, R,
        F=lambda x, u: A, H=lambda x: C, states=2, inputs=1, outputs=1,
    )  # fmt: skip
    for model in models:
        for one in (ExtendedKalmanFilter(model), UnscentedKalmanFilter(model, alpha=1.0)):
            found = one.run(y, u, start=one.init([1.0, 0.0], 1.0))
            for name in SHARED:
                np.testing.assert_allclose(
                    found[name], wanted[name], rtol=1e-12, atol=1e-12, err_msg=name
                )


# --- filterpy -----------------------------------------------------------------------------------

STEP = 0.05


def radar_step(x: Array) -> Array:
    """Ground distance, its rate and altitude of a plane in level flight."""
    return np.array([x[0] + STEP * x[1], x[1], x[2]])


def slant_range(x: Array) -> float:
    """The distance to the plane."""
    return math.sqrt(x[0] ** 2 + x[2] ** 2)


def slant_jacobian(x: Array) -> Array:
    """The derivatives of the slant range."""
    slant = math.sqrt(x[0] ** 2 + x[2] ** 2)
    return np.array([[x[0] / slant, 0.0, x[2] / slant]])


RADAR_Q = np.diag([1e-3, 1e-2, 0.1])


def radar_record() -> Array:
    """The ranges of 100 samples, with noise of 5 m."""
    k = np.arange(100)
    place = 100.0 * STEP * k
    return np.sqrt(place**2 + 1000.0**2) + np.random.default_rng(2).normal(0.0, 5.0, len(k))


@pytest.mark.parametrize("given", [True, False])
def test_radar_tracking_agrees_with_filterpy_extended_filter(given: bool) -> None:
    y, start = radar_record(), np.array([-100.0, 110.0, 1100.0])
    model = NonlinearModel(
        radar_step, slant_range, RADAR_Q, 25.0, F=None, H=slant_jacobian if given else None,
        states=3, outputs=1, sampling_period=STEP,
    )  # fmt: skip
    ours = ExtendedKalmanFilter(model)
    run = ours.run(y, start=ours.init(start, 50.0))
    peer = PeerEKF(3, 1)
    peer.x, peer.P, peer.Q, peer.R = start[:, None], 50.0 * np.eye(3), RADAR_Q, np.array([[25.0]])
    peer.F = np.array([[1.0, STEP, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    for k, value in enumerate(y):
        if k:
            peer.predict()
        peer.update(
            np.array([[value]]), lambda x: slant_jacobian(x[:, 0]),
            lambda x: np.array([[slant_range(x[:, 0])]]),
        )  # fmt: skip
        same = {"rtol": 1e-10 if given else 1e-9, "atol": 1e-9}
        np.testing.assert_allclose(run["state"][k], peer.x[:, 0], **same)
        np.testing.assert_allclose(run["covariance"][k], peer.P, **same)
        np.testing.assert_allclose(run["innovation"][k], peer.y[:, 0], **same)
        np.testing.assert_allclose(run["innovation_covariance"][k], peer.S, **same)
        assert run["log_likelihood"][k] == pytest.approx(peer.log_likelihood, rel=1e-9)


def pendulum_step(x: Array, u: Array) -> Array:
    """A step of a pendulum."""
    return np.array(
        [
            x[0] + STEP * x[1],
            x[1] + STEP * (u[0] - 19.62 * np.sin(x[0]) - 0.3 * x[1]),
        ]
    )


def pendulum_output(x: Array) -> Array:
    """The position of the pendulum."""
    return np.array([np.sin(x[0]), 1.0 - np.cos(x[0])])


@pytest.mark.parametrize("alpha", [0.1, 0.7])
def test_pendulum_agrees_with_filterpy_unscented_filter(alpha: float) -> None:
    rng = np.random.default_rng(3)
    u, noise = rng.normal(size=(100, 1)), np.diag([1e-4, 4e-4])
    x, rows = np.array([0.5, 0.0]), []
    for held in u:
        rows.append(pendulum_output(x) + 0.05 * rng.normal(size=2))
        x = pendulum_step(x, held)
    y = np.array(rows)
    model = NonlinearModel(
        pendulum_step, pendulum_output, noise, 0.0025, states=2, inputs=1, outputs=2,
        sampling_period=STEP,
    )  # fmt: skip
    ours = UnscentedKalmanFilter(model, alpha=alpha, beta=2.0, kappa=1.0)
    run = ours.run(y, u, start=ours.init([0.2, 0.1], 0.2))
    points = MerweScaledSigmaPoints(2, alpha, 2.0, 1.0)
    peer = PeerUKF(2, 2, STEP, pendulum_output, lambda x, dt, u: pendulum_step(x, u), points)
    peer.x, peer.P, peer.Q, peer.R = (
        np.array([0.2, 0.1]),
        0.2 * np.eye(2),
        noise,
        0.0025 * np.eye(2),
    )
    peer.sigmas_f = points.sigma_points(peer.x, peer.P)
    for k, value in enumerate(y):
        if k:
            peer.predict(u=u[k - 1])
        peer.update(value)
        np.testing.assert_allclose(run["state"][k], peer.x, rtol=1e-10, atol=1e-11)
        np.testing.assert_allclose(run["covariance"][k], peer.P, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(run["innovation_covariance"][k], peer.S, rtol=1e-10, atol=1e-12)
        assert run["log_likelihood"][k] == pytest.approx(peer.log_likelihood, rel=1e-9, abs=1e-9)


def test_gordon_growth_model_agrees_with_filterpy_unscented_filter() -> None:
    """Gordon, Salmond & Smith 1993, section 4.1; the cosine enters as the input."""
    rng = np.random.default_rng(4)
    u = np.cos(1.2 * np.arange(60))[:, None]
    x, rows = 0.1, []
    for (cosine,) in u:
        rows.append(x**2 / 20 + rng.normal())
        x = x / 2 + 25 * x / (1 + x**2) + 8 * cosine + math.sqrt(10) * rng.normal()
    model = NonlinearModel(
        "x/2 + 25*x/(1 + x^2) + 8*cosine", "x^2/20", 10.0, 1.0, state_names=["x"],
        input_names=["cosine"],
    )  # fmt: skip
    ours = UnscentedKalmanFilter(model, alpha=1.0, beta=0.0, kappa=2.0)
    run = ours.run(rows, u, start=ours.init([0.0], 5.0))
    points = MerweScaledSigmaPoints(1, 1.0, 0.0, 2.0)
    peer = PeerUKF(
        1, 1, 1.0, lambda x: x**2 / 20,
        lambda x, dt, u: x / 2 + 25 * x / (1 + x**2) + 8 * u, points,
    )  # fmt: skip
    peer.x, peer.P, peer.Q, peer.R = np.zeros(1), 5 * np.eye(1), 10 * np.eye(1), np.eye(1)
    peer.sigmas_f = points.sigma_points(peer.x, peer.P)
    for k, value in enumerate(rows):
        if k:
            peer.predict(u=u[k - 1])
        peer.update(np.array([value]))
        np.testing.assert_allclose(run["state"][k], peer.x, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(run["covariance"][k], peer.P, rtol=1e-10)


# --- 50 digits ----------------------------------------------------------------------------------


def test_extended_filter_agrees_with_50_digits() -> None:
    """On a pendulum with measured height, from text, with symbolic Jacobians."""
    model = NonlinearModel(
        ["a + w/20", "w + (u - 20*sin(a) - w/4)/20"], "a^2 + sin(w)/2", [1e-4, 1e-3], 0.01,
        state_names=["a", "w"], input_names=["u"],
    )  # fmt: skip
    ours, rng = ExtendedKalmanFilter(model), np.random.default_rng(5)
    y, u = 0.1 + 0.05 * rng.normal(size=40), rng.normal(size=40)
    run = ours.run(y, u, start=ours.init([0.3, 0.0], 0.1))
    with mp.workdps(50):
        x, P = mp.matrix([mp.mpf(0.3), 0]), mp.eye(2) * mp.mpf(0.1)
        noise = mp.diag([mp.mpf(1e-4), mp.mpf(1e-3)])
        for k in range(40):
            if k:
                held = mp.mpf(u[k - 1])
                F = mp.matrix([[1, mp.mpf(1) / 20], [-mp.cos(x[0]), 1 - mp.mpf(1) / 80]])
                x = mp.matrix(
                    [
                        x[0] + x[1] / 20,
                        x[1] + (held - 20 * mp.sin(x[0]) - x[1] / 4) / 20,
                    ]
                )
                P = F * P * F.T + noise
            H = mp.matrix([[2 * x[0], mp.cos(x[1]) / 2]])
            e = mp.mpf(y[k]) - x[0] ** 2 - mp.sin(x[1]) / 2
            S = (H * P * H.T)[0] + mp.mpf(0.01)
            K = P * H.T / S
            x, P = x + K * e, (mp.eye(2) - K * H) * P
            likelihood = -(e**2 / S + mp.log(2 * mp.pi * S)) / 2
            for i in range(2):
                assert run["state"][k, i] == pytest.approx(float(x[i]), rel=1e-12, abs=1e-12)
                for j in range(2):
                    wanted = float(P[i, j])
                    assert run["covariance"][k, i, j] == pytest.approx(wanted, rel=1e-11, abs=1e-15)
            assert run["innovation"][k, 0] == pytest.approx(float(e), abs=1e-12)
            assert run["log_likelihood"][k] == pytest.approx(float(likelihood), rel=1e-11)


# --- Continuous time, Jacobians -----------------------------------------------------------------


def runge_kutta(x: Any, u: float, h: float, steps: int) -> Any:
    """Van der Pol's equation by Runge-Kutta steps, for any number type."""

    def slope(x: Any) -> Any:
        return np.array([x[1], (1 - x[0] ** 2) * x[1] - x[0] + u])

    for _ in range(steps):
        k1 = slope(x)
        k2 = slope(x + h / 2 * k1)
        k3 = slope(x + h / 2 * k2)
        k4 = slope(x + h * k3)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def van_der_pol(**options: Any) -> NonlinearModel:
    """The equation as text, with the first state measured."""
    return NonlinearModel.from_ode(
        ["w", "(1 - a^2)*w - a + u"], "a", Q=1e-6, R=1e-2, state_names=["a", "w"],
        input_names=["u"],
        sampling_period=0.1, substeps=3, **options,
    )  # fmt: skip


def van_der_pol_slope(x: Array, u: Array) -> list[float]:
    """The equation in Python."""
    return [x[1], (1.0 - x[0] ** 2) * x[1] - x[0] + u[0]]


@pytest.mark.parametrize(("text", "accuracy"), [(True, 1e-14), (False, 2e-12)])
def test_runge_kutta_jacobian_agrees_with_complex_steps(text: bool, accuracy: float) -> None:
    model = van_der_pol() if text else NonlinearModel.from_ode(
        van_der_pol_slope, lambda x: x[0], Q=1e-6, R=1e-2, states=2, inputs=1, outputs=1,
        sampling_period=0.1, substeps=3,
    )  # fmt: skip
    one, x = ExtendedKalmanFilter(model), np.array([1.3, -0.7])
    posterior = one.init(x, np.eye(2)).posterior
    found = one.predict(posterior, [0.4])
    np.testing.assert_allclose(found.mean, runge_kutta(x, 0.4, 0.1 / 3, 3), rtol=1e-14)
    columns = [runge_kutta(x + 1e-30j * e, 0.4, 0.1 / 3, 3).imag / 1e-30 for e in np.eye(2)]
    F = np.array(columns).T
    np.testing.assert_allclose(found.covariance, F @ F.T + 1e-6 * np.eye(2), atol=accuracy)


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_estimates_converge_on_van_der_pol(kind: Any) -> None:
    """From a wrong initial state, on a record of an adaptive integrator, consistent with its
    covariance.
    """
    time, rng = 0.1 * np.arange(300), np.random.default_rng(6)
    solved = solve_ivp(
        lambda t, x: [x[1], (1 - x[0] ** 2) * x[1] - x[0]], (0, time[-1]), [2.0, 0.0],
        method="DOP853", rtol=1e-10, atol=1e-10, t_eval=time,
    )  # fmt: skip
    truth = solved.y.T
    y = truth[:, 0] + 0.1 * rng.normal(size=len(time))
    one = kind(van_der_pol())
    run = one.run(y, np.zeros(300), start=one.init([0.0, 1.0], 4.0), time=time)
    error = run["state"] - truth
    assert np.abs(error[0]).max() > 0.5
    assert np.abs(error[100:]).max() < 0.1
    squares = np.einsum("ki,kij,kj->k", error, np.linalg.inv(run["covariance"]), error)
    assert squares[100:].mean() < 6.0  # chi-squared of two degrees has a mean of 2


# --- Use in a bank ------------------------------------------------------------------------------


def test_extended_filter_bank_on_linear_models_equals_a_kalman_bank() -> None:
    _, u = record()
    x, rows = np.array([1.0, 0.0]), []
    for k, held in enumerate(u):  # with three times the gain for the second half
        rows.append(C @ x + D @ held + 0.3 * math.sin(k**2))
        x = A @ x + (3.0 if k >= 100 else 1.0) * B @ held
    y = np.array(rows)
    y[5], y[60:70] = np.nan, np.nan
    transition = [[0.95, 0.05], [0.1, 0.9]]
    linear = [LinearModel(A, gain * B, C, D, Q=Q, R=R) for gain in (1.0, 3.0)]
    kalman = IMM([KalmanFilter(model) for model in linear], transition)
    wanted = kalman.run(y, u, start=kalman.init([1.0, 0.0], 1.0))
    for kind in (ExtendedKalmanFilter, lambda model: UnscentedKalmanFilter(model, alpha=1.0)):
        bank = IMM([kind(linear_as_text(gain)) for gain in (1.0, 3.0)], transition)
        found = bank.run(y, u, start=bank.init([1.0, 0.0], 1.0))
        for name in ("state", "covariance", "probability", "innovation", "log_likelihood"):
            np.testing.assert_allclose(found[name], wanted[name], rtol=1e-10, atol=1e-11)


# --- Noise that changes, missing measurements ---------------------------------------------------


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_noise_per_row_agrees_with_the_recursion(kind: Any) -> None:
    """Against the explicit recursion: Q of row k drives the step after it, R belongs to y(k)."""
    y, u = record(50)
    scale = np.linspace(1.0, 5.0, 50)[:, None, None]
    one = kind(linear_as_text())
    start = one.init([1.0, 0.0], 1.0)
    run = one.run(y, u, start=start, Q=scale * Q, R=scale * R)
    x, P = np.array([1.0, 0.0]), np.eye(2)
    for k in range(50):
        if k:
            x, P = A @ x + B @ u[k - 1], A @ P @ A.T + scale[k - 1] * Q
        if not np.isnan(y[k, 0]):
            K = P @ C.T / (C @ P @ C.T + scale[k] * R)
            x, P = x + K @ (y[k] - C @ x - D @ u[k]), P - K @ C @ P
        np.testing.assert_allclose(run["state"][k], x, rtol=1e-10, atol=1e-11)
        np.testing.assert_allclose(run["covariance"][k], P, rtol=1e-10, atol=1e-11)
    state = start
    for k in range(50):
        state, estimate = one.step(state, y[k], u[k], Q=scale[k] * Q, R=scale[k] * R)
        for name in run.estimates:
            assert np.array_equal(estimate[name], run[name][k], equal_nan=True), name
    constant = one.run(y, u, start=start, Q=Q, R=R)
    plain = one.run(y, u, start=start)
    assert all(np.array_equal(constant[name], plain[name], equal_nan=True) for name in SHARED)


@pytest.mark.parametrize("kind", [ExtendedKalmanFilter, UnscentedKalmanFilter])
def test_partly_missing_row_uses_the_remaining_measurements(kind: Any) -> None:
    names = {"state_names": ["a", "w"]}
    f, noise = ["a + w/20", "w - sin(a)"], [[0.02, 0.01], [0.01, 0.03]]
    both = kind(NonlinearModel(f, ["sin(a)", "w^2 + a"], Q, noise, **names))
    second = kind(NonlinearModel(f, ["w^2 + a"], Q, 0.03, **names))
    found, wanted = (
        one.run(y, start=one.init([0.5, 0.2], 0.3))
        for one, y in ((both, [[np.nan, 0.7]] * 5), (second, [0.7] * 5))
    )
    for name in ("state", "covariance", "log_likelihood"):
        np.testing.assert_allclose(found[name], wanted[name], rtol=1e-13)
    np.testing.assert_allclose(found["innovation"][:, 1:], wanted["innovation"], rtol=1e-12)
    assert np.isnan(found["innovation"][:, 0]).all()
    spread = found["innovation_covariance"]
    assert np.isnan(spread[:, 0]).all()
    assert np.isnan(spread[:, :, 0]).all()
    np.testing.assert_allclose(spread[:, 1, 1], wanted["innovation_covariance"][:, 0, 0])
    assert found.missing == 5


def test_exactly_known_state_is_only_predicted() -> None:
    """For a singular P the Cholesky factor has a zero column."""
    model = NonlinearModel(["a + w/20", "w"], "a", 0.0, 1.0, state_names=["a", "w"])
    for one in (ExtendedKalmanFilter(model), UnscentedKalmanFilter(model)):
        run = one.run(np.ones(5), start=one.init([1.0, 2.0], [1.0, 0.0]))
        assert np.array_equal(run["state"][:, 1], np.full(5, 2.0))
        assert np.array_equal(run["variance"][:, 1], np.zeros(5))
