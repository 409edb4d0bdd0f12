"""The smoother against filterpy, least squares over the whole record, and a published example."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter as PeerKalman
from filterpy.kalman import MerweScaledSigmaPoints
from filterpy.kalman import UnscentedKalmanFilter as PeerUKF
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from reobserve import (
    ExtendedKalmanFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    UnscentedKalmanFilter,
    rts_smoother,
)
from tests.reobserve.observers.test_nonlinear_filters import (
    STEP,
    A,
    B,
    C,
    D,
    Q,
    R,
    linear_as_text,
    pendulum_output,
    pendulum_step,
    record,
)

Array = NDArray[np.float64]

# Annual flow of the Nile at Aswan 1871-1970 [10^8 m^3] (Durbin & Koopman 2012, section 2.2.5).
NILE = np.array([
    1120, 1160, 963, 1210, 1160, 1160, 813, 1230, 1370, 1140, 995, 935, 1110, 994, 1020, 960, 1180,
    799, 958, 1140, 1100, 1210, 1150, 1250, 1260, 1220, 1030, 1100, 774, 840, 874, 694, 940, 833,
    701, 916, 692, 1020, 1050, 969, 831, 726, 456, 824, 702, 1120, 1100, 832, 764, 821, 768, 845,
    864, 862, 698, 845, 744, 796, 1040, 759, 781, 865, 845, 944, 984, 897, 822, 1010, 771, 676, 649,
    846, 812, 742, 801, 1040, 860, 874, 848, 890, 744, 749, 838, 1050, 918, 986, 797, 923, 975, 815,
    1020, 906, 901, 1170, 912, 746, 919, 718, 714, 740,
])  # fmt: skip


def filters() -> dict[str, Any]:
    """The three filters of one linear system."""
    text = linear_as_text()
    return {
        "kalman": KalmanFilter(LinearModel(A, B, C, D, Q=Q, R=R)),
        "extended": ExtendedKalmanFilter(text),
        "unscented": UnscentedKalmanFilter(text, alpha=1.0),
    }


@pytest.mark.parametrize("kind", ["kalman", "extended", "unscented"])
def test_smoother_agrees_with_least_squares_over_the_record(kind: str) -> None:
    """With gaps and a different Q in each row: mean and covariance from the information matrix."""
    one, rows = filters()[kind], 40
    y, u = record(rows)
    noise = np.linspace(1.0, 4.0, rows)[:, None, None] * Q
    changes = {} if kind == "kalman" else {"Q": noise}
    if kind == "kalman":
        noise = np.tile(Q, (rows, 1, 1))
    run = one.run(y, u, start=one.init([1.0, 0.0], 1.0), **changes)
    found = rts_smoother(run)
    information, right = np.zeros((2 * rows, 2 * rows)), np.zeros(2 * rows)
    information[:2, :2], right[:2] = np.eye(2), [1.0, 0.0]
    for k in range(rows):
        here, both = slice(2 * k, 2 * k + 2), slice(2 * k, 2 * k + 4)
        if not np.isnan(y[k, 0]):
            information[here, here] += C.T @ C / R
            right[here] += C.T @ (y[k] - D @ u[k]) / R[0, 0]
        if k + 1 < rows:
            jump, weight = np.hstack([-A, np.eye(2)]), np.linalg.inv(noise[k])
            information[both, both] += jump.T @ weight @ jump
            right[both] += jump.T @ weight @ (B @ u[k])
    covariance = np.linalg.inv(information)
    mean = covariance @ right
    np.testing.assert_allclose(found["state"].ravel(), mean, rtol=1e-8, atol=1e-9)
    for k in range(rows):
        block = covariance[2 * k : 2 * k + 2, 2 * k : 2 * k + 2]
        np.testing.assert_allclose(found["covariance"][k], block, rtol=1e-8, atol=1e-11)
        np.testing.assert_allclose(found["variance"][k], np.diag(block), rtol=1e-8)
    assert np.array_equal(found["state"][-1], run["state"][-1])
    assert np.array_equal(found.time, run.time)


def test_smoother_agrees_with_filterpy() -> None:
    y, u = record(60)
    one = filters()["kalman"]
    run = one.run(y, u, start=one.init([1.0, 0.0], 1.0))
    peer = PeerKalman(2, 1)
    peer.F, peer.Q = A, Q
    # filterpy's smoother has no input: the driven part of the state is subtracted before.
    driven = [np.zeros(2)]
    for held in u[:-1]:
        driven.append(A @ driven[-1] + B @ held)
    free = run["state"] - driven
    mean, covariance, _, _ = peer.rts_smoother(free[:, :, None], run["covariance"])
    found = rts_smoother(run)
    np.testing.assert_allclose(found["state"], mean[:, :, 0] + driven, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(found["covariance"], covariance, rtol=1e-10, atol=1e-12)


def test_unscented_smoother_agrees_with_filterpy() -> None:
    rng, noise = np.random.default_rng(7), np.diag([1e-4, 4e-4])
    y = 0.3 * rng.normal(size=(50, 2))
    model = NonlinearModel(
        pendulum_step, pendulum_output, noise, 0.0025, states=2, inputs=1, outputs=2,
        sampling_period=STEP,
    )  # fmt: skip
    one, u = UnscentedKalmanFilter(model, alpha=0.5, beta=2.0, kappa=1.0), np.full((50, 1), 0.3)
    run = one.run(y, u, start=one.init([0.2, 0.1], 0.2))
    points = MerweScaledSigmaPoints(2, 0.5, 2.0, 1.0)
    peer = PeerUKF(
        2, 2, STEP, pendulum_output, lambda x, dt: pendulum_step(x, np.array([0.3])), points
    )
    peer.Q = noise
    mean, covariance, _ = peer.rts_smoother(run["state"], run["covariance"])
    found = rts_smoother(run)
    np.testing.assert_allclose(found["state"], mean, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(found["covariance"], covariance, rtol=1e-9, atol=1e-11)


def nile(kind: str) -> Any:
    """The local level model with the variances of Durbin & Koopman 2012, section 2.10.3."""
    if kind == "kalman":
        return KalmanFilter(LinearModel([[1.0]], C=[[1.0]], Q=1469.1, R=15099.0))
    text = NonlinearModel("level", "level", 1469.1, 15099.0, state_names=["level"])
    return (ExtendedKalmanFilter if kind == "extended" else UnscentedKalmanFilter)(text)


@pytest.mark.parametrize("kind", ["kalman", "extended", "unscented"])
def test_smoother_agrees_with_published_nile_results(kind: str) -> None:
    """The diffuse likelihood is that of the differences, which do not depend on the first level."""
    one = nile(kind)
    # With a diffuse initial state the first measurement becomes the level, with its variance.
    run = one.run(NILE[1:], start=one.init([NILE[0]], 15099.0, u=[]))
    changes, eye = np.diff(NILE), np.eye(len(NILE) - 1)
    noise = 2 * eye - np.eye(len(eye), k=1) - np.eye(len(eye), k=-1)
    expected = multivariate_normal(cov=1469.1 * eye + 15099.0 * noise).logpdf(changes)
    assert run["log_likelihood"].sum() == pytest.approx(expected, rel=1e-10)
    # The variance converges to P^2 + Q P = Q R (section 2.11): predicted q/2 + sqrt(q^2/4 + q R).
    ahead = 1469.1 / 2 + np.sqrt(1469.1**2 / 4 + 1469.1 * 15099.0)
    settled = ahead * 15099.0 / (ahead + 15099.0)
    assert run["variance"][-1, 0] == pytest.approx(settled, rel=1e-9)
    # The smoothed levels solve a tridiagonal system.
    count = len(NILE)
    jumps = np.diff(np.eye(count), axis=0)
    information = np.eye(count) / 15099.0 + jumps.T @ jumps / 1469.1
    level = np.linalg.solve(information, NILE / 15099.0)
    found = rts_smoother(run)
    np.testing.assert_allclose(found["state"][:, 0], level[1:], rtol=1e-10)
    np.testing.assert_allclose(found["variance"][:, 0], np.diag(np.linalg.inv(information))[1:])
