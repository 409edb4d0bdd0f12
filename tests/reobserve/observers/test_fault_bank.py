"""A bank for faults that jump or drift: the same filters by hand, exact covariances, and jumps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from reobserve import IMM, AugmentedKalmanFilter, FaultBank, KalmanFilter, LinearModel
from reobserve.core.errors import InputError

T = 0.1
PLANT = LinearModel(
    [[1, T], [0, 0.9]], [[0], [T]], [[1, 0], [0, 1]], Q=[1e-6, 1e-5], R=[1e-4, 1e-3],
    sampling_period=T, state_names=["angle", "rate"], output_names=["angle", "rate"],
)  # fmt: skip
E = np.array([[0.0, 0.0], [T, 0.0]])
F = np.array([[0.0, 0.0], [0.0, 1.0]])
DRIFT, JUMP = np.array([0.02, 0.01]), np.array([4.0, 2.0])


def bank(**options: object) -> FaultBank:
    return FaultBank(
        PLANT, fault_matrix=E, drift=DRIFT, jump=JUMP, jump_rate=0.2, jump_time=0.3,
        output_fault_matrix=F,
        fault_names=["push", "bias"], **options,
    )  # fmt: skip


def by_hand() -> IMM:
    """The same bank from van Loan's exponential and the definition of the chain."""
    G = np.zeros((4, 4))  # of [f, f']
    G[:2, 2:] = np.eye(2)
    models = []
    for mode in range(3):
        density = np.diag([*(JUMP**2 * (np.arange(2) == mode - 1)), *DRIFT**2])
        loan = expm(np.block([[-G, density], [np.zeros((4, 4)), G.T]]) * T)
        noise = loan[4:, 4:].T @ loan[:4, 4:]
        A = np.zeros((6, 6))
        A[:2, :2], A[:2, 2:4], A[2:, 2:] = PLANT.A, E, expm(G * T)
        Q = np.zeros((6, 6))
        Q[:2, :2], Q[2:, 2:] = PLANT.Q, noise
        C = np.hstack([PLANT.C, F, np.zeros((2, 2))])
        B = np.vstack([PLANT.B, np.zeros((4, 1))])
        models.append(LinearModel(A, B, C, None, Q=Q, R=PLANT.R, sampling_period=T, check=False))
    leave, back = 1 - np.exp(-0.2 * T), 1 - np.exp(-T / 0.3)
    chain = [[1 - leave, leave / 2, leave / 2], [back, 1 - back, 0], [back, 0, 1 - back]]
    return IMM([KalmanFilter(one) for one in models], chain)


def record(rows: int = 400) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A push that jumps and a bias that drifts."""
    rng = np.random.default_rng(3)
    fault = np.column_stack([np.where(np.arange(rows) < 200, 0.0, 1.5), 0.002 * np.arange(rows)])
    u, x, y = rng.standard_normal((rows, 1)), np.zeros(2), np.empty((rows, 2))
    for k in range(rows):
        y[k] = x + F @ fault[k] + rng.multivariate_normal([0, 0], PLANT.R)
        x = PLANT.A @ x + PLANT.B @ u[k] + E @ fault[k] + rng.multivariate_normal([0, 0], PLANT.Q)
    return y, u, fault


def test_bank_is_the_interacting_multiple_model_of_its_definition() -> None:
    y, u, _ = record()
    ours, other = bank(), by_hand()
    P = np.diag([1e-2, 1e-2, 0.5, 0.5, 1e-4, 1e-4])
    run = ours.run(
        y,
        u,
        start=ours.init([0, 0], 1e-2, fault=[0.1, 0.0], fault_covariance=0.5, rate_covariance=1e-4),
    )
    expected = other.run(y, u, start=other.init([0, 0, 0.1, 0, 0, 0], P, probabilities=[1, 0, 0]))
    whole = np.hstack([run["state"], run["fault"], run["fault_rate"]])
    np.testing.assert_allclose(whole, expected["state"], rtol=1e-8, atol=1e-10)
    variances = np.hstack([run["variance"], run["fault_variance"], run["fault_rate_variance"]])
    np.testing.assert_allclose(variances, expected["variance"], rtol=1e-8)
    np.testing.assert_allclose(run["covariance"], expected["covariance"][:, :2, :2], rtol=1e-7)
    np.testing.assert_allclose(run["probability"], expected["probability"], rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(run["log_likelihood"], expected["log_likelihood"], atol=1e-8)
    assert run["fault_push"].shape == run["state_rate"].shape == (400,)
    state = ours.init([0, 0], 1e-2, fault=[0.1, 0.0], fault_covariance=0.5, rate_covariance=1e-4)
    for k in range(30):
        state, estimate = ours.step(state, y[k], u[k])
        for name in run:
            assert np.array_equal(estimate[name], run[name][k]), name


def test_jump_is_followed_at_once_and_a_drift_without_noise() -> None:
    y, u, fault = record()
    ours = bank()
    run = ours.run(y, u, start=ours.init([0, 0], 1e-2))
    error = run["fault"] - fault
    assert run["probability"][:195, 0].mean() > 0.95
    assert run["probability"][200:206, 1].max() > 0.5
    best = np.inf
    for walk in np.geomspace(1e-6, 1e-1, 26):  # one random walk for jump and drift
        one = AugmentedKalmanFilter(
            PLANT, fault_matrix=E, random_walk=[walk, 1e-5], output_fault_matrix=F
        )
        other = one.run(y, u, start=one.init([0, 0], 1e-2, unknown_input_covariance=1e-6))
        off = other["unknown_input"] - fault
        best = min(best, float(np.sqrt((off[:, 0] ** 2).mean())))
    assert np.sqrt((error[:, 0] ** 2).mean()) < best
    assert np.sqrt((error[50:, 1] ** 2).mean()) < 0.03


def test_estimates_do_not_depend_on_the_unit_of_a_fault() -> None:
    y, u, _ = record()
    found = []
    for scale in (1.0, 1e-3):
        one = FaultBank(
            PLANT,
            fault_matrix=E / scale,
            drift=DRIFT * scale,
            jump=JUMP * scale,
            jump_rate=0.2,
            jump_time=0.3,
            output_fault_matrix=F / scale,
        )
        found.append(one.run(y, u, start=one.init([0, 0], 1e-2)))
        np.testing.assert_allclose(
            found[-1]["fault"] / scale, found[0]["fault"], rtol=1e-6, atol=1e-9
        )
    np.testing.assert_allclose(found[1]["log_likelihood"], found[0]["log_likelihood"], atol=1e-7)


def test_faults_that_do_the_same_and_wrong_numbers_are_refused() -> None:
    with pytest.raises(InputError, match="leaves a mode of state, faults and their rates"):
        FaultBank(
            PLANT,
            fault_matrix=[[0, 0], [T, 2 * T]],
            drift=0.1,
            jump=1.0,
            jump_rate=0.1,
            jump_time=0.1,
        )
    for change, message in (
        ({"drift": 0.0}, "drift: 0 must be"),
        ({"jump": [1.0, 2.0]}, "jump"),
        ({"jump_rate": -1.0}, "jump_rate"),
        ({"jump_time": np.inf}, "jump_time"),
        ({"fault_matrix": [[1.0]]}, "fault_matrix: has shape"),
        ({"fault_names": ["a", "b"]}, "fault_names: are 2, must be 1"),
    ):
        given = {"fault_matrix": [[0], [T]], "drift": 0.1, "jump": 1.0, "jump_rate": 0.1,
                 "jump_time": 0.1} | change  # fmt: skip
        with pytest.raises(InputError, match=message):
            FaultBank(PLANT, **given)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="fault_covariance"):
        bank().init([0, 0], 1.0, fault_covariance=[1.0, 1.0, 1.0])
