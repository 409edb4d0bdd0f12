"""Unknown inputs are found exactly without noise, agree with filterpy with noise, or are
refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter as FilterpyKalmanFilter
from numpy.typing import NDArray

from reobserve.core.discretisation import zero_order_hold
from reobserve.core.errors import InputError
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.kalman import KalmanFilter
from reobserve.systems.linear import LinearModel
from tests.reobserve.observers.actuator_models import ripple

Array = NDArray[np.float64]

PERIOD = 0.1
HELD = zero_order_hold([[0.0, 1.0], [-2.0, -0.4]], [[0.0], [1.0]], PERIOD)
FORCE = HELD[1]  # an unknown force acts like the known one
POSITION = np.array([[1.0, 0.0]])


def mass(R: float = 1e-4, H: Any = POSITION) -> LinearModel:
    """A mass on a spring with measured position."""
    return LinearModel(*HELD, H, Q=1e-8, R=R, sampling_period=PERIOD)


def moved(u: Array, force: Array, start: Any = (0.3, -0.1)) -> Array:
    """The states at the rows, under inputs and forces from each row on."""
    x, rows = np.array(start), []
    for known, unknown in zip(u, force, strict=True):
        rows.append(x)
        x = HELD[0] @ x + HELD[1] @ (known + unknown)
    return np.array(rows)


def inputs(rows: int) -> tuple[Array, Array]:
    time = PERIOD * np.arange(rows)[:, None]
    return np.sin(time), np.where(time < 4.0, 0.5, 0.5 + 0.3 * np.sin(1.3 * time))


def test_unknown_input_is_exact_without_noise_one_row_later() -> None:
    u, force = inputs(120)
    states = moved(u, force)
    model = LinearModel(*HELD, np.eye(2), Q=0.0, R=1e-14, sampling_period=PERIOD)
    observer = AugmentedKalmanFilter(model, fault_matrix=FORCE, random_walk=1.0)
    run = observer.run(
        states,
        u,
        start=observer.init([0.0, 0.0], 1.0, unknown_input=[0.0], unknown_input_covariance=1.0),
    )
    assert np.abs(run["unknown_input"][1:] - force[:-1]).max() < 1e-9
    assert np.abs(run["state"] - states).max() < 1e-9
    plain = KalmanFilter(model)
    other = plain.run(states, u, start=plain.init([0.0, 0.0], 1.0))
    assert np.abs(other["innovation"][5:]).max() > 0.01, "it knows of no force"


def test_sensor_bias_is_identified_by_the_second_sensor() -> None:
    u, none = inputs(400)[0], np.zeros((400, 1))
    states = moved(u, none)
    y = states[:, [0, 0]] + np.array([0.0, 0.7])
    model = mass(1e-8, [[1.0, 0.0], [1.0, 0.0]])
    observer = AugmentedKalmanFilter(
        model, fault_matrix=np.zeros((2, 1)), random_walk=1e-12, output_fault_matrix=[[0.0], [1.0]]
    )
    run = observer.run(y, u, start=observer.init([0.0, 0.0], 1.0))
    assert run["unknown_input"][-1] == pytest.approx([0.7], abs=1e-6)
    assert run["unknown_input_variance"].shape == (400, 1)
    assert run["unknown_input_variance"][-1, 0] < 1e-8


def test_augmented_filter_agrees_with_filterpy() -> None:
    u, force = inputs(200)
    y = moved(u, force)[:, :1] + 0.01 * ripple(200)
    observer = AugmentedKalmanFilter(mass(), fault_matrix=FORCE, random_walk=1e-2)
    run = observer.run(
        y,
        u,
        start=observer.init([0.1, 0.2], 0.5, unknown_input=[0.4], unknown_input_covariance=2.0),
    )
    peer = FilterpyKalmanFilter(3, 1, 1)
    peer.F = np.block([[HELD[0], FORCE], [np.zeros((1, 2)), np.eye(1)]])
    peer.B, peer.H = np.vstack([HELD[1], [[0.0]]]), np.array([[1.0, 0.0, 0.0]])
    peer.Q, peer.R = np.diag([1e-8, 1e-8, PERIOD * 1e-2]), np.array([[1e-4]])
    peer.x, peer.P = np.array([[0.1], [0.2], [0.4]]), np.diag([0.5, 0.5, 2.0])
    found = []
    for k in range(200):
        if k:
            peer.predict(u[k - 1][:, None])
        peer.update(y[k][:, None])
        found.append((peer.x[:, 0].copy(), peer.P.copy(), peer.S.copy(), peer.log_likelihood))
    means, covariances, S, logs = (np.array(part) for part in zip(*found, strict=True))
    ours = np.hstack([run["state"], run["unknown_input"]])
    assert ours == pytest.approx(means, rel=1e-10, abs=1e-12)
    spread = np.hstack([run["variance"], run["unknown_input_variance"]])
    assert spread == pytest.approx(covariances.diagonal(axis1=1, axis2=2), rel=1e-10)
    assert run["covariance"] == pytest.approx(covariances[:, :2, :2], rel=1e-9, abs=1e-15)
    assert run["unknown_input_covariance"] == pytest.approx(covariances[:, 2:, 2:], rel=1e-10)
    assert run["innovation_covariance"] == pytest.approx(S, rel=1e-10)
    assert run["log_likelihood"] == pytest.approx(logs, rel=1e-8)
    # With noise the force is also found, as well as its slow random walk allows.
    assert np.sqrt(np.mean((run["unknown_input"][60:] - force[59:-1]) ** 2)) < 0.15


NAMES = ("fault_matrix", "random_walk", "output_fault_matrix")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            (np.ones((3, 1)), 1.0),
            r"fault_matrix: has shape \(3, 1\), must be \(2, q\), as A has",
        ),
        (
            (np.ones((2, 0)), 1.0),
            r"fault_matrix: has shape \(2, 0\), must be \(2, q\), as A has",
        ),
        ((FORCE, -1.0), "random_walk: must be positive semidefinite"),
        ((FORCE, 1.0, [[1.0, 0.0]]), r"output_fault_matrix: has shape \(1, 2\), must be \(1, 1\)"),
        (
            (np.hstack([FORCE, 2 * FORCE]), 1.0),
            "fault_matrix: leaves a mode",
        ),
        (
            (np.zeros((2, 1)), 1.0),
            "fault_matrix: leaves .* that does not decay, of the eigenvalue 1",
        ),
    ],
)
def test_unknown_inputs_that_cannot_be_estimated_are_refused(arguments: Any, said: str) -> None:
    with pytest.raises(InputError, match=f"^{said}"):
        AugmentedKalmanFilter(mass(), **dict(zip(NAMES, arguments, strict=False)))


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"mean": [0.0]}, r"mean: has shape \(1,\), must be a list of 2 numbers"),
        ({"unknown_input": [0.0, 1.0]}, r"unknown_input: has shape \(2,\), must be a list of 1"),
        ({"unknown_input_covariance": -1.0}, "unknown_input_covariance: must be positive semi"),
    ],
)
def test_invalid_initial_states_are_refused(changed: dict[str, Any], said: str) -> None:
    given: dict[str, Any] = {"mean": [0.0, 0.0], "covariance": 1.0, **changed}
    with pytest.raises(InputError, match=f"^{said}"):
        AugmentedKalmanFilter(mass(), fault_matrix=FORCE, random_walk=1.0).init(**given)


def test_time_varying_noise_agrees_with_the_augmented_kalman_filter() -> None:
    u, force = inputs(80)
    y = moved(u, force)[:, :1] + 0.01 * np.random.default_rng(3).standard_normal((80, 1))
    observer = AugmentedKalmanFilter(mass(), fault_matrix=FORCE, random_walk=1e-2)
    zero, one = np.zeros((1, 2)), np.eye(1)
    whole = KalmanFilter(
        LinearModel(
            np.block([[HELD[0], FORCE], [zero, one]]), np.vstack([HELD[1], [[0.0]]]),
            np.hstack([POSITION, [[0.0]]]), Q=np.diag([1e-8, 1e-8, PERIOD * 1e-2]), R=1e-4,
            sampling_period=PERIOD, check=False,
        )
    )  # fmt: skip
    scale = 1 + np.arange(80) % 7
    Q, R = 1e-6 * scale[:, None, None] * np.eye(2), 1e-4 * scale[::-1, None, None] * np.eye(1)
    wide = np.zeros((80, 3, 3))
    wide[:, :2, :2], wide[:, 2, 2] = Q, PERIOD * 1e-2
    start = observer.init([0.3, 0.0], 1e-2)
    run = observer.run(y, u, start=start, Q=Q, R=R)
    other = whole.run(y, u, start=start, Q=wide, R=R)
    np.testing.assert_array_equal(run["state"], other["state"][:, :2])
    np.testing.assert_array_equal(run["unknown_input"], other["state"][:, 2:])
    np.testing.assert_array_equal(run["log_likelihood"], other["log_likelihood"])
    assert np.abs(run["state"] - observer.run(y, u, start=start)["state"]).max() > 1e-4
    state = start
    for k in range(80):
        state, estimate = observer.step(state, y[k], u[k], Q=Q[k], R=R[k])
        np.testing.assert_array_equal(estimate["state"], run["state"][k])
    one_for_all = observer.run(y, u, start=start, Q=1e-6)
    each = observer.run(y, u, start=start, Q=np.tile(1e-6 * np.eye(2), (80, 1, 1)))
    np.testing.assert_array_equal(one_for_all["state"], each["state"])
    with pytest.raises(InputError, match=r"^Q: has shape \(3, 2, 2\), must be one covariance or"):
        observer.run(y, u, Q=Q[:3], start=start)
