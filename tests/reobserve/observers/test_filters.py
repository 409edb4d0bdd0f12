"""Kalman filter and SVSF: closed forms, 50 digits, bitwise identical steps and runs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import filterpy.kalman
import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from reobserve.core.errors import DivergenceError, InputError
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import Correction, FilterSteps, Gaussian, KalmanState
from reobserve.observers.kalman import LINEAR, Gain, KalmanFilter, gain_function
from reobserve.observers.run import Run
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.systems.linear import LinearModel
from tests.reobserve.observers.actuator_models import (
    ACTUATOR,
    Reference,
    exact,
    from_rows_on,
    kalman_law,
    motion_model,
    reference,
    ripple,
    rounded,
    run_over,
    simulated,
    square_wave,
    switching_law,
    velocity_model,
)

Array = NDArray[np.float64]

PSI, GAMMA = [0.01, 0.3, 20.0], 0.1
NORMAL, MOTION = velocity_model("normal"), motion_model("normal")
ONE = LinearModel([[1.0]], np.empty((1, 0)), [[1.0]], Q=0.0, R=4.0)
NOISE = np.array([0.01, 0.5, 20.0])


def svsf(model: LinearModel, psi: Any = PSI, gamma: float = GAMMA) -> Any:
    return SmoothVariableStructureFilter(model, boundary_layer=psi, convergence_rate=gamma)


def motion_record(rows: int) -> tuple[Array, Array]:
    """Measurements and controls of the leaky actuator, so that the model is wrong."""
    u = square_wave(rows, 12)
    return simulated(motion_model("leakage"), u) + NOISE * ripple(rows, 3), u


def same_bits(one: dict[str, Array], other: dict[str, Array]) -> bool:
    return one.keys() == other.keys() and all(
        np.array_equal(values, other[name], equal_nan=True) for name, values in one.items()
    )


def reported(*runs: Run[KalmanState]) -> dict[str, Array]:
    """The results of consecutive runs, and the last state."""
    state = runs[-1].end
    joined = {name: np.concatenate([run[name] for run in runs]) for name in runs[0].estimates}
    assert state.sample is not None
    return {
        **joined,
        **vars(state.posterior),
        "sample": state.sample,
        "count": np.array(state.count),
    }


def both(one: GaussianFilter, posterior: Gaussian, y: Any, u: Any) -> Correction:
    """Prediction and correction, with an input held over the step."""
    return one.correct(one.predict(posterior, u), y, u)


def relative(found: Array, expected: Array) -> float:
    """The largest error of a column over the largest value of that column."""
    return float(np.max(np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)))


# --- The Kalman filter --------------------------------------------------------------------------


def test_information_from_constant_measurements_adds_up() -> None:
    z = 3.0 + 2.0 * ripple(500)
    kalman = KalmanFilter(ONE)
    run = kalman.run(z, start=kalman.init([1.0], 9.0))
    count = np.arange(1, 501)
    information = 1 / 9 + count / 4.0
    assert run["variance"][:, 0] == pytest.approx(1 / information, rel=1e-13)
    mean = (1.0 / 9 + np.cumsum(z[:, 0]) / 4.0) / information
    assert run["state"][:, 0] == pytest.approx(mean, rel=1e-13)


def test_likelihoods_multiply_to_the_density_of_the_record() -> None:
    # z ~ N(1, 9 * ones + 4 I): determinant and inverse in closed form.
    z = 3.0 + 2.0 * ripple(40)
    kalman = KalmanFilter(ONE)
    run = kalman.run(z, start=kalman.init([1.0], 9.0))
    d = z[:, 0] - 1.0
    distance = d @ d / 4 - 9 / (16 * (1 + 40 * 9 / 4)) * d.sum() ** 2
    log_determinant = 40 * np.log(4) + np.log(1 + 40 * 9 / 4)
    expected = -0.5 * (distance + log_determinant + 40 * np.log(2 * np.pi))
    assert run["log_likelihood"].sum() == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("mode", ACTUATOR)
@pytest.mark.parametrize("build", [velocity_model, motion_model])
def test_covariance_converges_to_the_riccati_solution(build: Any, mode: str) -> None:
    model = build(mode)
    A, _, H, _, Q, R = model.arrays
    kalman = KalmanFilter(model)
    rows, m = 3000, model.outputs
    still = np.zeros((rows, m)), np.zeros((rows, 1))
    run = kalman.run(*still, start=kalman.init(np.zeros(model.states), 1.0))
    expected = solve_discrete_are(A.T, H.T, Q, R)
    found = kalman.predict(run.end.posterior, [0.0]).covariance
    assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs((found - expected) / scale).max() < 1e-9
    predicted = np.sqrt(np.diag(H @ expected @ H.T + R))
    assert np.allclose(np.sqrt(np.diag(run["innovation_covariance"][-1])), predicted, rtol=1e-9)


def test_exact_noise_free_model_is_tracked_from_any_initial_state() -> None:
    u = square_wave(800, 60)
    z = simulated(NORMAL, u, [1.0, -2.0, 0.5, 1.0])
    kalman = KalmanFilter(NORMAL)
    run = run_over(kalman, z, u, np.zeros(4), 10.0)
    assert abs(run["innovation"][0, 0]) > 0.5
    assert np.abs(run["innovation"][-200:]).max() < 1e-8


# --- Joseph's form ------------------------------------------------------------------------------

CORRELATED = np.array(
    [
        [1.0, 0.5, -0.3, 0.2],
        [0.5, 2.0, 0.4, -0.1],
        [-0.3, 0.4, 1.5, 0.6],
        [0.2, -0.1, 0.6, 1.2],
    ]
)


def test_joseph_form_keeps_covariance_accuracy_for_precise_measurements() -> None:
    model = replace(NORMAL, R=1e-14)
    kalman = KalmanFilter(model)
    z, u = [0.7], [0.0]
    found = kalman.correct(
        kalman.init(np.zeros(4), CORRELATED).posterior, z, u
    ).posterior.covariance
    with mpmath.workdps(50):
        P, H, R = exact(CORRELATED), exact(model.arrays.C), exact(model.arrays.R)
        K = P * H.T * (H * P * H.T + R) ** -1
        expected = rounded((mpmath.eye(4) - K * H) * P)
    assert expected[0, 0] == pytest.approx(1e-14, rel=1e-13)
    assert np.abs(found / expected - 1).max() < 1e-12
    assert np.array_equal(found, found.T)
    assert np.linalg.eigvalsh(found)[0] > 0

    H = model.arrays.C
    gain = CORRELATED @ H.T / (H @ CORRELATED @ H.T + model.arrays.R)
    short = (np.eye(4) - gain @ H) @ CORRELATED
    assert np.abs(short / expected - 1).max() > 5e-4


def correlated(covariance: Array) -> Array:
    """Correlation coefficients of covariances."""
    deviation = np.sqrt(np.abs(np.diag(covariance)))
    return covariance / np.outer(deviation, deviation)


def test_joseph_form_stays_positive_definite_where_the_short_form_fails() -> None:
    R = 1e-14 * np.diag(MOTION.arrays.C @ MOTION.arrays.C.T)
    model = replace(MOTION, R=R, Q=1e-12)
    A, _, H, _, Q, _ = model.arrays
    kalman = KalmanFilter(model)
    posterior = kalman.init(np.zeros(5), 1.0).posterior
    short, P = np.eye(5), mpmath.eye(5)
    errors, least_short = [], []
    with mpmath.workdps(50):
        a, _, h, _, q, r = map(exact, model.arrays)
        for _ in range(12):
            posterior = kalman.correct(
                kalman.predict(posterior, [0.0]), np.zeros(3), [0.0]
            ).posterior
            P = a * P * a.T + q
            P = P - P * h.T * (h * P * h.T + r) ** -1 * h * P
            size = rounded(P) / correlated(rounded(P))
            errors.append(float(np.abs((posterior.covariance - rounded(P)) / size).max()))
            assert np.linalg.eigvalsh(correlated(posterior.covariance))[0] > 0.04
            short = A @ short @ A.T + Q
            short = short - short @ H.T @ np.linalg.inv(H @ short @ H.T + np.diag(R)) @ H @ short
            least_short.append(np.linalg.eigvalsh(correlated(short))[0])
    assert errors[0] < 1e-14
    assert max(errors) < 1e-4
    assert errors[-1] < 1e-14
    assert min(least_short) < -1


def test_svsf_needs_the_joseph_form() -> None:
    # For a gain other than Kalman's the short form differs and is not symmetric.
    smooth = svsf(NORMAL, 1.0, 0.1)
    found = smooth.correct(smooth.init(np.zeros(4), CORRELATED).posterior, [0.4], [0.0]).posterior
    K, H = np.array([[0.4], [0.0], [0.0], [0.0]]), NORMAL.arrays.C
    M = np.eye(4) - K @ H
    whole = M @ CORRELATED @ M.T + 1e-4 * K @ K.T
    assert found.covariance == pytest.approx(whole, rel=1e-14)
    assert (M @ CORRELATED)[0, 0] == pytest.approx(0.6)
    assert found.covariance[0, 0] == pytest.approx(0.36 + 0.16e-4)


# --- 50 digits ----------------------------------------------------------------------------------


def alone(model: LinearModel, law: Any, z: Array, u: Array) -> Reference:
    """The reference for a bank of one."""
    P0 = np.diag([18.0, 0.0038, 0.012, 0.0044, 0.0021])
    return reference([model], [law], [[1.0]], np.zeros(5), P0, z, u)


@pytest.mark.parametrize("kind", ["KF", "SVSF"])
def test_filter_with_three_outputs_agrees_with_50_digits(kind: str) -> None:
    z, u = motion_record(30)
    law = kalman_law if kind == "KF" else switching_law(PSI, GAMMA)
    made = KalmanFilter(MOTION) if kind == "KF" else svsf(MOTION)
    run = run_over(made, z, u, np.zeros(5), [18.0, 0.0038, 0.012, 0.0044, 0.0021])
    expected = alone(MOTION, law, z, u)
    variance = np.diagonal(expected.covariance, axis1=1, axis2=2)
    assert relative(run["state"], expected.estimate) < 1e-13
    assert relative(run["variance"], variance) < 1e-13
    if kind == "SVSF":
        share = (np.abs(run["innovation"]) > PSI).mean(axis=0)
        assert np.all((share > 0.05) & (share < 0.95)), "inside of the layer and outside"


# --- The smooth variable structure filter -------------------------------------------------------

SQUARE = LinearModel(
    [[0.9, 0.2], [-0.1, 0.8]], [[0.1], [0.3]], [[2.0, 1.0], [-1.0, 3.0]], Q=0.01, R=0.1
)


def contraction(model: LinearModel, gamma: float, rows: int = 25) -> None:
    """Outside of the layer e(k+1|k+1) = -sign(e(k+1|k)) gamma |e(k|k)| for each output."""
    m = model.outputs
    smooth = svsf(model, 1e-12, gamma)
    posterior = smooth.init(np.zeros(model.states), 1.0).posterior
    posterior = Gaussian(posterior.mean, posterior.covariance, np.arange(1.0, m + 1))
    z = 5.0 * ripple(rows, m)
    for row in z:
        reported = both(smooth, posterior, row, [0.3])
        expected = -np.sign(reported.innovation) * gamma * np.abs(posterior.error)
        scale = 1e-14 * (5.0 + np.abs(reported.innovation).max())
        assert np.abs(reported.posterior.error - expected).max() < scale
        posterior = reported.posterior
    assert np.abs(posterior.error) == pytest.approx(gamma**rows * np.arange(1.0, m + 1), abs=1e-12)


@pytest.mark.parametrize("gamma", [0.0, 0.1, 0.9])
@pytest.mark.parametrize("model", [SQUARE, MOTION], ids=["square H", "fewer outputs than states"])
def test_output_error_contracts_by_gamma_outside_the_layer(
    model: LinearModel, gamma: float
) -> None:
    contraction(model, gamma)


def test_svsf_in_a_wide_layer_follows_the_open_loop_model() -> None:
    z, u = motion_record(200)
    A, B = MOTION.arrays.A, MOTION.arrays.B
    x, rows = np.zeros(5), []
    for held in u:
        x = A @ x + B @ held
        rows.append(x)
    apart = []
    for width in (1e5, 1e7, 1e9):
        smooth = svsf(MOTION, width)
        run = run_over(smooth, z, u, np.zeros(5), 1.0)
        apart.append(float(np.abs(run["state"] - rows).max()))
        largest = float(np.abs(run["innovation"]).max())
        # Each sample corrects less than (1 + gamma) e^2 / psi, accumulated over 200 samples.
        assert apart[-1] < 200 * 1.1 * largest**2 / width * 200
    assert apart[0] / apart[1] == pytest.approx(100, rel=0.05)
    assert apart[1] / apart[2] == pytest.approx(100, rel=0.01)
    assert apart[0] > 1e-6


def test_zero_innovation_gives_no_correction_and_no_division_by_zero() -> None:
    smooth = svsf(MOTION)
    start = smooth.init(np.zeros(5), 1.0).posterior
    reported = both(
        smooth, Gaussian(start.mean, start.covariance, np.ones(3)), [0.0, 0.0, 0.0], [0.0]
    )
    assert not reported.innovation.any()
    assert not reported.posterior.mean.any()
    assert np.isfinite(reported.posterior.covariance).all()
    # gamma |e(k|k)| / psi remains of the gain and enters the covariance.
    P = MOTION.arrays.A @ start.covariance @ MOTION.arrays.A.T + MOTION.arrays.Q
    K = np.linalg.pinv(MOTION.arrays.C) @ np.diag(GAMMA / np.array(PSI))
    M = np.eye(5) - K @ MOTION.arrays.C
    expected = M @ P @ M.T + K @ MOTION.arrays.R @ K.T
    assert reported.posterior.covariance == pytest.approx(expected, rel=1e-12)


def test_correction_stays_in_the_row_space_of_the_measurement_matrix() -> None:
    model = LinearModel([[1.0, 0.1], [0.0, 1.0]], [[0.0], [0.1]], [[3.0, 4.0]], Q=0.01, R=0.1)
    smooth = svsf(model, 0.5, 0.0)
    posterior = smooth.init([1.0, 2.0], 1.0).posterior
    predicted = smooth.predict(posterior, [1.0])
    moved = smooth.correct(predicted, [20.0], [1.0]).posterior.mean - predicted.mean
    assert predicted.mean == pytest.approx([1.2, 2.1])
    assert moved == pytest.approx((20.0 - 12.0) * np.array([3.0, 4.0]) / 25, rel=1e-14)
    inside = smooth.correct(predicted, [12.1], [1.0]).posterior.mean - predicted.mean
    assert inside == pytest.approx(0.1**2 / 0.5 * np.array([3.0, 4.0]) / 25, rel=1e-11)


def test_weighted_inverse_does_not_depend_on_coordinates() -> None:
    def weighted(model: LinearModel) -> SmoothVariableStructureFilter:
        return SmoothVariableStructureFilter(
            model, boundary_layer=PSI[1:], convergence_rate=GAMMA, inverse="weighted"
        )

    A, B, H, D, Q, R = MOTION.arrays
    turn = np.eye(5) + 0.2 * np.cos(np.arange(25.0)).reshape(5, 5)
    back = np.linalg.inv(turn)
    spread = turn @ Q @ turn.T
    turned = LinearModel(
        turn @ A @ back, turn @ B, (H @ back)[1:], Q=(spread + spread.T) / 2, R=R[1:, 1:], D=D[1:]
    )
    plain = LinearModel(A, B, H[1:], Q=Q, R=R[1:, 1:], D=D[1:])
    z, u = motion_record(300)
    one, two = weighted(plain), weighted(turned)
    found = one.run(z[:, 1:], u, start=one.init(np.zeros(5), np.eye(5)))
    other = two.run(z[:, 1:], u, start=two.init(np.zeros(5), turn @ turn.T))
    np.testing.assert_allclose(other["state"] @ back.T, found["state"], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(other["log_likelihood"], found["log_likelihood"], rtol=1e-6)
    # With a thin layer and gamma = 0, no output error remains.
    thin = SmoothVariableStructureFilter(
        plain, boundary_layer=1e-9, convergence_rate=0.0, inverse="weighted"
    )
    posterior = thin.predict(thin.init(np.zeros(5), 1.0).posterior, [1.0])
    reported = thin.correct(posterior, [3.0, 4.0], [1.0])
    np.testing.assert_allclose(reported.posterior.error, 0.0, atol=1e-10)
    P = posterior.covariance
    K = P @ H[1:].T @ np.linalg.inv(H[1:] @ P @ H[1:].T)
    np.testing.assert_allclose(
        reported.posterior.mean - posterior.mean, K @ reported.innovation, rtol=1e-9
    )


def test_unknown_inverse_is_refused() -> None:
    with pytest.raises(InputError, match="inverse: 'left' must be one of pseudo, weighted"):
        SmoothVariableStructureFilter(ONE, boundary_layer=1.0, convergence_rate=0.1, inverse="left")


def test_gain_is_continuous_at_the_edge_of_the_layer() -> None:
    smooth = svsf(ONE, 2.0, 0.5)
    start = Gaussian(np.zeros(1), np.eye(1), np.ones(1))
    found = [smooth.correct(start, [z]).posterior.mean[0] for z in (2 - 1e-9, 2.0, 2 + 1e-9)]
    assert found[1] == pytest.approx(2.5, rel=1e-15)
    assert found == pytest.approx([2.5] * 3, abs=1e-8)


# --- Steps, runs and resuming -------------------------------------------------------------------


def by_steps(one: GaussianFilter, z: Array, state: KalmanState, u: Array) -> dict[str, Array]:
    rows = []
    for measurement, control in zip(z, u, strict=True):
        state, estimate = one.step(state, measurement, control)
        rows.append(estimate.estimates)
    assert state.sample is not None
    return {
        **{name: np.array([row[name] for row in rows]) for name in rows[0]},
        **vars(state.posterior), "sample": state.sample, "count": np.array(state.count),
    }  # fmt: skip


@pytest.mark.parametrize("before", [True, False], ids=["a period before", "at the first row"])
@pytest.mark.parametrize("made", [KalmanFilter(MOTION), svsf(MOTION)], ids=["KF", "SVSF"])
def test_stepping_and_split_runs_are_bitwise_identical(made: GaussianFilter, before: bool) -> None:
    z, u = motion_record(120)
    z[40, 1] = z[41] = np.nan
    start = made.init(np.zeros(5), 1.0, u=u[0] if before else None)
    run = made.run(z, u, start=start)
    assert same_bits(by_steps(made, z, start, u), reported(run))
    for cut in (1, 42, 57):  # after 42 the last measurement is missing
        first = made.run(z[:cut], u[:cut], start=start)
        second = made.run(z[cut:], u[cut:], start=first.end)
        assert same_bits(reported(first, second), reported(run))
        assert first.missing + second.missing == run.missing == 2
        assert np.array_equal(np.append(first.time, second.time), run.time)
    assert run.time[0] == (5e-3 if before else 0.0)
    assert not start.posterior.mean.any()
    assert np.array_equal(start.posterior.covariance, np.eye(5)), "a state is a value"


@pytest.mark.parametrize("made", [KalmanFilter(MOTION), svsf(MOTION)], ids=["KF", "SVSF"])
def test_first_row_corrects_and_later_rows_predict_with_the_previous_input(
    made: GaussianFilter,
) -> None:
    z, u = motion_record(9)
    start = made.init(np.linspace(0, 1, 5), 1.0)
    run = made.run(z, u, start=start)
    found = made.correct(start.posterior, z[0], u[0])
    for k in range(9):
        if k:
            found = made.correct(made.predict(found.posterior, u[k - 1]), z[k], u[k])
        assert np.array_equal(run["state"][k], found.posterior.mean)
        assert np.array_equal(run["innovation"][k], found.innovation)
    moved = u.copy()
    moved[-1] += 1.0  # feeds through to the last row, and drives no later row
    changed = made.run(z, moved, start=start)
    assert np.array_equal(changed["state"][:-1], run["state"][:-1])
    apart = run["innovation"][-1] - changed["innovation"][-1]
    assert apart == pytest.approx(MOTION.D[:, 0], rel=1e-12)


@pytest.mark.parametrize("made", [KalmanFilter(MOTION), svsf(MOTION)], ids=["KF", "SVSF"])
def test_missing_measurements_are_bridged_by_prediction(made: GaussianFilter) -> None:
    z, u = motion_record(60)
    z[20:30] = np.nan
    start = made.init(np.zeros(5), 1.0)
    run = made.run(z, u, start=start)
    assert run.missing == 10
    posterior = made.run(z[:20], u[:20], start=start).end.posterior
    last = posterior.error
    for k in range(20, 30):
        posterior = made.predict(posterior, u[k - 1])
        assert np.array_equal(run["state"][k], posterior.mean)
        assert np.array_equal(run["variance"][k], np.diag(posterior.covariance))
    assert np.array_equal(posterior.error, last)
    gaps = np.isnan(z).any(axis=1)
    assert np.array_equal(np.isnan(run["innovation"]).all(axis=1), gaps)
    assert np.array_equal(run["log_likelihood"] == 0.0, gaps)
    found = made.correct(posterior, [np.nan] * 3, u[0])
    assert found.posterior is posterior
    assert found.log_likelihood == 0.0
    assert np.isnan(found.innovation_covariance).all()


@pytest.mark.parametrize("lost", [[0], [1], [2], [0, 2]], ids=str)
@pytest.mark.parametrize("kind", ["KF", "SVSF"])
def test_partial_measurement_corrects_like_a_reduced_model(kind: str, lost: list[int]) -> None:
    """A filter whose model has only these outputs gives the same result."""

    def made(outputs: list[int]) -> GaussianFilter:
        model = replace(
            MOTION, C=MOTION.C[outputs], D=MOTION.D[outputs],
            R=MOTION.R[np.ix_(outputs, outputs)],
        )  # fmt: skip
        chosen: GaussianFilter = svsf(model, [PSI[o] for o in outputs])
        return KalmanFilter(model) if kind == "KF" else chosen

    z, u = motion_record(20)
    whole, kept = made([0, 1, 2]), [o for o in range(3) if o not in lost]
    posterior = whole.run(z, u, start=whole.init(np.linspace(0, 1, 5), 1.0)).end.posterior
    partial = z[-1] + 0.1
    partial[lost] = np.nan
    found = whole.correct(posterior, partial, u[-1])
    alone = made(kept).correct(
        replace(posterior, error=posterior.error[kept]), partial[kept], u[-1]
    )
    for one, other in (
        (found.posterior.mean, alone.posterior.mean),
        (found.posterior.covariance, alone.posterior.covariance),
        (found.posterior.error[kept], alone.posterior.error),
        (found.innovation[kept], alone.innovation),
        (found.innovation_covariance[np.ix_(kept, kept)], alone.innovation_covariance),
        (found.log_likelihood, alone.log_likelihood),
    ):
        assert one == pytest.approx(other, rel=1e-9, abs=1e-12 * np.abs(other).max())
    assert np.array_equal(found.posterior.error[lost], posterior.error[lost])
    assert np.isnan(found.innovation[lost]).all()
    assert np.isnan(found.innovation_covariance[lost]).all()


def test_correction_reports_innovation_and_likelihood() -> None:
    kalman = KalmanFilter(MOTION)
    z, u = motion_record(5)
    run = kalman.run(z[:4], u[:4], start=kalman.init(np.zeros(5), 1.0))
    posterior = run.end.posterior
    found = kalman.correct(kalman.predict(posterior, u[3]), z[4], u[4])
    A, B, H, D, Q, R = MOTION.arrays
    P = A @ posterior.covariance @ A.T + Q
    S = H @ P @ H.T + R
    e = z[4] - H @ (A @ posterior.mean + B @ u[3]) - D @ u[4]
    assert found.innovation == pytest.approx(e, rel=1e-12)
    assert found.innovation_covariance == pytest.approx(S, rel=1e-12, abs=1e-12)
    logged = -0.5 * (e @ np.linalg.solve(S, e) + np.linalg.slogdet(2 * np.pi * S)[1])
    assert found.log_likelihood == pytest.approx(logged, rel=1e-13)
    row = kalman.step(run.end, z[4], u[4])[1]
    assert np.array_equal(row["innovation"], found.innovation)
    assert row["log_likelihood"] == found.log_likelihood


def test_input_of_the_first_row_is_used_with_feedthrough() -> None:
    z, u = motion_record(3)
    kalman = KalmanFilter(MOTION)
    run = kalman.run(z[:1], u[:1], start=kalman.init(np.zeros(5), 1.0))
    assert run["innovation"][0] == pytest.approx(z[0] - MOTION.D @ u[0], rel=1e-15)
    still = KalmanFilter(replace(MOTION, D=None))
    runs = [still.run(z[:1], v, start=still.init(np.zeros(5), 1.0)) for v in (u[:1], u[:1] + 1)]
    assert np.array_equal(runs[0]["state"], runs[1]["state"])


# --- User-defined gains -------------------------------------------------------------------------


@gain_function
def _shared_gain(
    cross: Array, factor: Array, innovation: Array, error: Array, parameters: Array, gain: Array
) -> None:
    n, m = gain.shape
    for a in range(n):
        for o in range(m):
            gain[a, o] = parameters[m * a + o]


@dataclass(frozen=True, eq=False, repr=False)
class OwnFilter(GaussianFilter):
    """A user-defined filter whose gain is part of a matrix."""

    matrix: Array
    share: float

    steps: ClassVar[FilterSteps] = LINEAR

    @property
    def method(self) -> Gain:
        return Gain(_shared_gain.compiled, self.share * self.matrix.ravel())


def test_user_defined_gain_runs_in_the_compiled_loop() -> None:
    z, u = motion_record(80)
    A, B, H, D, Q, R = MOTION.arrays
    K = np.linalg.pinv(H) @ np.diag([0.5, 0.3, 0.1])
    own = OwnFilter(MOTION, 2.0 * K, 0.5)
    run = run_over(own, z, u, np.zeros(5), 1.0)
    x, P, M = np.zeros(5), np.eye(5), np.eye(5) - K @ H
    means, variances = [], []
    for measurement, control, now in zip(z, u, from_rows_on(u), strict=True):
        x, P = A @ x + B @ control, A @ P @ A.T + Q
        x = x + K @ (measurement - H @ x - D @ now)
        P = M @ P @ M.T + K @ R @ K.T
        means.append(x)
        variances.append(np.diag(P))
    assert relative(run["state"], np.array(means)) < 1e-12
    assert relative(run["variance"], np.array(variances)) < 1e-12


# --- Divergence ---------------------------------------------------------------------------------

# State 1 grows tenfold per sample, unobservable from the measurement of state 2.
UNSEEN = LinearModel([[10.0, 0.0], [0.0, 0.5]], np.empty((2, 0)), [[0.0, 1.0]], Q=0.0, R=1.0)


@pytest.mark.parametrize("taken", [True, False], ids=["measured", "missing"])
def test_overflowing_variance_is_reported_with_its_row(taken: bool) -> None:
    smooth = svsf(replace(UNSEEN, sampling_period=0.25), 1.0)
    start = smooth.init([1.0, 1.0], 1.0, u=())
    # The variance after k rows is 100^k: beyond the largest float, 1.8e308, after 155 of them.
    z = np.full((400, 1), 0.3 if taken else np.nan)
    run = smooth.run(z, start=start, on_divergence="return")
    assert run.diverged_at == pytest.approx(154 * 0.25)  # the last row that is finite
    assert run["state"].shape == (154, 2)
    assert run.time[-1] == run.diverged_at
    assert run["variance"][-1, 0] == pytest.approx(1e308, rel=1e-12)
    assert np.isfinite(run["variance"]).all()
    assert run.missing == (0 if taken else 154)
    assert run.end.posterior is start.posterior


def test_overflowing_mean_is_reported_with_its_row() -> None:
    # Without uncertainty of state 1 its covariance stays zero, and the mean is 10^k.
    smooth = svsf(UNSEEN, 1.0)
    start = smooth.init([1.0, 1.0], [0.0, 1.0], u=())
    run = smooth.run(np.full((400, 1), 0.3), start=start, on_divergence="return")
    assert run.diverged_at == len(run) == 308
    assert run["state"][-1, 0] == pytest.approx(1e308, rel=1e-12)


def test_diverging_step_is_reported() -> None:
    smooth = svsf(UNSEEN, 1.0)
    with pytest.raises(DivergenceError, match=r"^SmoothVariableStructureFilter diverged"):
        smooth.step(smooth.init([1e308, 0.0], 1.0, u=()), [0.0])
    with pytest.raises(
        DivergenceError, match=r"^SmoothVariableStructureFilter diverged"
    ) as reported:
        smooth.predict(smooth.init([1e308, 0.0], 1.0).posterior)
    assert reported.value.time == 0.0


@pytest.mark.parametrize(
    ("sample", "said"),
    [
        ([np.nan], r"start.sample: \[nan\] must be 1 measurements and 1 finite inputs"),
        ([0.0, np.nan], r"start.sample: \[0.0, nan\] must be 1 measurements and 1 finite inputs"),
        ("x", "start.sample: 'x' is not a number or an array of numbers"),
    ],
)
def test_invalid_states_of_a_step_are_refused(sample: Any, said: str) -> None:
    kalman = KalmanFilter(NORMAL)
    state = replace(kalman.init(np.zeros(4), 1.0), sample=sample)
    with pytest.raises(InputError, match=f"^{said}$"):
        kalman.run([[0.0]], [[0.0]], start=state)


# --- Noise that changes from row to row ---------------------------------------------------------


def changing_noise(rows: int) -> tuple[Array, Array]:
    """Q and R of each row, shapes (k, 4, 4) and (k, 1, 1)."""
    k = np.arange(rows)[:, None, None]
    return (1.5 + np.sin(0.3 * k)) * 1e-4 * CORRELATED, 0.02 * (1.2 + np.cos(0.7 * k))


def test_time_varying_noise_agrees_with_filterpy() -> None:
    u = square_wave(120, 12)
    z = simulated(NORMAL, u) + 0.1 * ripple(120)
    Q, R = changing_noise(120)
    kalman = KalmanFilter(NORMAL)
    run = kalman.run(z, u, start=kalman.init(np.zeros(4), CORRELATED), Q=Q, R=R)
    peer = filterpy.kalman.KalmanFilter(4, 1, 1)
    peer.F, peer.B, peer.H = (part.copy() for part in NORMAL.arrays[:3])
    peer.P = CORRELATED.copy()
    for k in range(120):
        if k:
            peer.predict(u[k - 1][:, None], Q=Q[k - 1])
        peer.update(z[k][:, None], R=R[k])
        for name, value in (
            ("state", peer.x[:, 0]), ("covariance", peer.P), ("innovation", peer.y[:, 0]),
            ("innovation_covariance", peer.S),
        ):  # fmt: skip
            assert run[name][k] == pytest.approx(value, rel=1e-9, abs=1e-11), (name, k)
        assert run["log_likelihood"][k] == pytest.approx(peer.log_likelihood, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("made", [KalmanFilter(NORMAL), svsf(NORMAL, 1.0)], ids=["KF", "SVSF"])
def test_time_varying_noise_is_identical_by_steps_and_runs(made: GaussianFilter) -> None:
    z, u = simulated(NORMAL, square_wave(40, 7)) + 0.1 * ripple(40), square_wave(40, 7)
    z[5] = np.nan
    Q, R = changing_noise(40)
    start = made.init(np.zeros(4), 1.0)
    whole = made.run(z, u, start=start, Q=Q, R=R)
    first = made.run(z[:15], u[:15], start=start, Q=Q[:15], R=R[:15])
    rest = made.run(z[15:], u[15:], start=first.end, Q=Q[15:], R=R[15:])
    assert same_bits(reported(whole), reported(first, rest))
    state = start
    for k in range(40):
        state, row = made.step(state, z[k], u[k], Q=Q[k], R=R[k])
        for name in whole.estimates:
            assert np.array_equal(row[name], whole[name][k], equal_nan=True), (name, k)
    constant = made.run(z, u, start=start, Q=np.tile(NORMAL.Q, (40, 1, 1)), R=NORMAL.R)
    assert np.array_equal(constant["covariance"], made.run(z, u, start=start)["covariance"])


def test_noise_of_wrong_shape_or_sign_is_refused() -> None:
    kalman = KalmanFilter(NORMAL)
    start, z, u = kalman.init(np.zeros(4), 1.0), np.zeros(3), np.zeros(3)
    with pytest.raises(InputError, match=r"^Q: has shape \(2, 4, 4\), must be one covariance or"):
        kalman.run(z, u, start=start, Q=np.zeros((2, 4, 4)))
    R = np.ones((3, 1, 1))
    R[1] = -2.0
    with pytest.raises(InputError, match=r"^R\[1\]: must be positive semidefinite"):
        kalman.run(z, u, start=start, R=R)
