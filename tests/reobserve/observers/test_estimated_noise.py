"""R estimated while running: each row is a step of expectation maximisation that forgets."""

from __future__ import annotations

import numpy as np
import pytest

from reobserve import (
    IMM,
    AugmentedKalmanFilter,
    ExtendedKalmanFilter,
    KalmanFilter,
    LinearModel,
    NonlinearModel,
    SmoothVariableStructureFilter,
    UnscentedKalmanFilter,
)
from reobserve.core.errors import InputError

T = 0.1
A, C = np.array([[1, T], [0, 1]]), np.array([[1.0, 0.0], [1.0, 0.5]])
Q, R = np.diag([1e-5, 1e-3]), np.array([[0.04, 0.01], [0.01, 0.09]])


def model(noise: object) -> LinearModel:
    return LinearModel(A, C=C, Q=Q, R=noise, sampling_period=T)


def record(rows: int, noise: np.ndarray, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    x, y = np.zeros(2), np.empty((rows, 2))
    w, v = (rng.multivariate_normal([0, 0], one, rows) for one in (Q, noise))
    for k in range(rows):
        y[k] = C @ x + v[k]
        x = A @ x + w[k]
    return y


def test_rows_are_steps_of_expectation_maximisation() -> None:
    """The mean of v v' given the row, from the joint distribution of x and v."""
    y = record(60, R)
    y[20, 0] = y[31] = np.nan
    observer = KalmanFilter(model(R), noise_memory=4.0)
    run = observer.run(y, start=observer.init([0, 0], 1.0))
    x, P, used = np.zeros(2), np.eye(2), R.copy()
    ratio = R[0, 1] / np.sqrt(R[0, 0] * R[1, 1])
    for k, row in enumerate(y):
        if k:
            x, P = A @ x, A @ P @ A.T + Q
        seen = ~np.isnan(row)
        variances = used.diagonal().copy()
        if seen.any():
            # The joint covariance of [x, v] and y = [C 1] [x, v].
            joint = np.block([[P, np.zeros((2, 2))], [np.zeros((2, 2)), used]])
            H = np.hstack([C, np.eye(2)])[seen]
            K = joint @ H.T @ np.linalg.inv(H @ joint @ H.T)
            mean = np.concatenate([x, [0, 0]]) + K @ (row[seen] - C[seen] @ x)
            after = joint - K @ H @ joint
            x, P = mean[:2], after[:2, :2]
            found = mean[2:] ** 2 + after.diagonal()[2:]
            g = max(T / 4.0, 1 / (k + 20))
            variances[seen] += g * (found - variances)[seen]
        np.testing.assert_allclose(run["noise_variance"][k], variances, rtol=1e-11)
        np.testing.assert_allclose(run["state"][k], x, rtol=1e-9, atol=1e-12)
        apart = ratio * np.sqrt(variances[0] * variances[1])
        used = np.array([[variances[0], apart], [apart, variances[1]]])
    again = observer.run(y[40:], start=observer.run(y[:40], start=observer.init([0, 0], 1)).end)
    assert np.array_equal(again["noise_variance"], run["noise_variance"][40:])


@pytest.mark.parametrize("wrong", [0.1, 10.0])
def test_estimate_comes_to_the_noise_of_the_record(wrong: float) -> None:
    y = record(40_000, R)
    linear = KalmanFilter(model(wrong * R), noise_memory=100.0)
    run = linear.run(y, start=linear.init([0, 0], 1.0))
    found = run["noise_variance"][20_000:].mean(axis=0)
    np.testing.assert_allclose(found, R.diagonal(), rtol=0.03)
    right = KalmanFilter(model(R))
    expected = right.run(y, start=right.init([0, 0], 1.0))
    assert run["log_likelihood"][20_000:].mean() == pytest.approx(
        expected["log_likelihood"][20_000:].mean(), abs=0.01
    )


def test_filters_of_the_same_linear_model_estimate_the_same() -> None:
    y = record(300, 4 * R)
    text = NonlinearModel(
        ["x + 0.1*v", "v"], ["x", "x + 0.5*v"], Q, R, state_names=["x", "v"], sampling_period=T
    )
    linear = KalmanFilter(model(R), noise_memory=5.0)
    expected = linear.run(y, start=linear.init([0, 0], 1.0))["noise_variance"]
    for observer in (
        ExtendedKalmanFilter(text, noise_memory=5.0),
        UnscentedKalmanFilter(text, noise_memory=5.0),
        IMM([KalmanFilter(model(R))] * 2, [[0.9, 0.1], [0.2, 0.8]], noise_memory=5.0),
        IMM([KalmanFilter(model(R))] * 2, [[0.9, 0.1], [0.2, 0.8]], mixing=False, noise_memory=5.0),
    ):
        state = observer.init([0, 0], 1.0)
        run = observer.run(y, start=state)
        np.testing.assert_allclose(run["noise_variance"], expected, rtol=1e-9)
        for k, row in enumerate(y[:30]):
            state, estimate = observer.step(state, row)
            assert np.array_equal(estimate["noise_variance"], run["noise_variance"][k])
    many = linear.run(np.array([y, y[::-1]]), start=linear.init([0, 0], 1.0))
    assert np.array_equal(many["noise_variance"][0], expected)
    assert np.array_equal(many.end[0].noise, expected[-1])


def test_bank_takes_the_mean_over_its_modes() -> None:
    other = LinearModel(A, C=C, Q=100 * Q, R=R, sampling_period=T)
    bank = IMM(
        [KalmanFilter(model(R)), KalmanFilter(other)], [[0.9, 0.1], [0.2, 0.8]], noise_memory=5.0
    )
    state = bank.init([0, 0], 1.0)
    y = record(40, R, seed=3)
    for k, row in enumerate(y):
        before, (state, estimate) = state, bank.step(state, row)
        if k == 0:
            continue
        # Each filter alone from the mixed posteriors, which a bank without memory does the same.
        used = before.noise
        g = max(T / 5.0, 1 / (k + 20))
        ratio = R[0, 1] / np.sqrt(R[0, 0] * R[1, 1])
        apart = ratio * np.sqrt(used[0] * used[1])
        noise = np.array([[used[0], apart], [apart, used[1]]])
        plain = IMM(bank.filters, bank.transition)
        alone = plain._checked(
            type(before)(
                before.means, before.covariances, before.errors, before.log_probabilities,
                before.sample, before.count,
            )
        )  # fmt: skip
        _, same = plain.step(alone, row, R=noise)
        np.testing.assert_allclose(same["probability"], estimate["probability"], rtol=1e-9)
        change = np.zeros(2)
        mu = np.exp(before.log_probabilities)
        c = mu @ bank.transition
        for j, one in enumerate(bank.filters):
            w = bank.transition[:, j] * mu / c[j]
            x = w @ before.means
            spread = before.means - x
            P = np.einsum("i,iab->ab", w, before.covariances + spread[:, :, None] * spread[:, None])
            P = A @ P @ A.T + one.model.Q
            S = C @ P @ C.T + noise
            e = row - C @ A @ x
            G = noise @ np.linalg.inv(S)
            now = (G @ (np.outer(e, e) - S) @ G.T).diagonal()
            change += estimate["probability"][j] * now
        np.testing.assert_allclose(estimate["noise_variance"], used + g * change, rtol=1e-8)


def test_noise_that_cannot_be_seen_is_refused() -> None:
    with pytest.raises(InputError, match=r"would take .* memories"):
        KalmanFilter(LinearModel([[1.0]], C=[[1.0]], Q=1.0, R=0.01), noise_memory=100.0)
    drift = LinearModel([[1.0, 0], [0, 1.0]], C=[[1.0, 0]], Q=[1e-4, 1e-4], R=1.0)
    with pytest.raises(InputError, match="comes to no rest"):
        KalmanFilter(drift, noise_memory=100.0)
    one = LinearModel([[0.9]], C=[[1.0]], Q=1e-3, R=1.0)
    with pytest.raises(InputError, match="must be the sampling period, 1 s, or longer"):
        KalmanFilter(one, noise_memory=0.5)
    svsf = SmoothVariableStructureFilter
    with pytest.raises(InputError, match="has another gain than Kalman's"):
        svsf(one, boundary_layer=1.0, convergence_rate=0.1, noise_memory=10.0)
    observer = KalmanFilter(one, noise_memory=10.0)
    with pytest.raises(InputError, match="R: must be left out"):
        observer.run([0.0, 1.0], start=observer.init([0], 1), R=1.0)
    continuous = LinearModel.from_ode([[-1]], C=[[1]], density=0.1, R=1.0, sampling_period=0.1)
    uneven = KalmanFilter(continuous, noise_memory=5.0)
    with pytest.raises(InputError, match=r"of 0\.1 s, which noise_memory counts$"):
        uneven.run([0.0, 0.0], start=uneven.init([0], 1), time=[0.0, 1.0])
    with pytest.raises(InputError, match=r"start\.noise: is missing"):
        observer.run([0.0], start=KalmanFilter(one).init([0], 1))
    other = LinearModel([[0.9]], C=[[1.0]], Q=1e-3, R=2.0)
    with pytest.raises(InputError, match=r"filters\[1\] has another R"):
        IMM([KalmanFilter(one), KalmanFilter(other)], np.eye(2), noise_memory=10.0)


def test_unknown_inputs_leave_the_noise_visible() -> None:
    plant = LinearModel([[0.95]], C=[[1.0]], Q=1e-6, R=1.0)
    observer = AugmentedKalmanFilter(
        plant, fault_matrix=[[0.05]], random_walk=1e-4, noise_memory=500.0
    )
    y = np.random.default_rng(2).normal(0.0, 2.0, 20_000)
    run = observer.run(y, start=observer.init([0.0], 1.0))
    assert run["noise_variance"][10_000:].mean() == pytest.approx(4.0, rel=0.03)
