"""Errors in Gadsden, McCullough & Habibi 2011: how the printed form fails, and the correction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_are

from reobserve.core.documents import read_yaml
from reobserve.observers.gaussian_state import Gaussian
from reobserve.observers.imm import IMM, mixing_probabilities, update_probabilities
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter
from reobserve.systems.linear import LinearModel
from reobserve_papers.metrics.metrics import lookup
from reobserve_papers.steps.evaluation import evaluate
from tests import ROOT
from tests.reobserve.observers.actuator_models import (
    left_limit,
    motion_model,
    ripple,
    run_over,
    simulated,
    square_wave,
    velocity_model,
)
from tests.reobserve_papers.papers import fixed_parameters

Array = NDArray[np.float64]

SEED = read_yaml(ROOT / "config" / "config.yaml")["seed"]
MU = np.array([0.6, 0.3, 0.1])

NORMAL, MOTION = velocity_model("normal"), motion_model("normal")
STICKY = 0.023 * np.ones((3, 3)) + 0.931 * np.eye(3)  # p_ii = 0.954
THIRDS = np.full(3, 1 / 3)
FULL = LinearModel([[0.9, 0.2], [-0.1, 0.8]], [[0.1], [0.3]], np.eye(2), Q=0.01, R=0.1)


def scalar(H: float = 1.0, Q: float = 0.0, A: float = 1.0) -> LinearModel:
    return LinearModel([[A]], np.empty((1, 0)), [[H]], Q=Q, R=1.0)


# --- (8): the sum ends at j, must end at r ------------------------------------------------------


def printed_sums(transition: Array, mu: Array) -> Array:
    return np.array([transition[: j + 1, j] @ mu[: j + 1] for j in range(len(mu))])


def mixing(transition: Array, mu: Array) -> tuple[Array, Array]:
    """Mixing weights mu(i|j) and c_j of the implementation."""
    weights, predicted = np.empty_like(transition), np.empty_like(mu)
    mixing_probabilities(transition, np.log(mu), weights, predicted)
    return weights.T, np.exp(predicted)


def test_equation_8_as_printed_gives_mixing_weights_that_do_not_sum_to_one() -> None:
    c = printed_sums(STICKY, THIRDS)
    assert c == pytest.approx([0.318, 0.977 / 3, 1 / 3])
    assert c.sum() < 0.98
    weights = STICKY * THIRDS[:, None] / c
    assert weights.sum(axis=0) == pytest.approx([1.0482, 1.0235, 1.0], abs=5e-5)
    # Three filters that agree on a state of 1 are then mixed to:
    assert (weights.T @ np.ones(3))[0] - 1 > 0.048

    weights, c = mixing(STICKY, THIRDS)
    assert c == pytest.approx(THIRDS, rel=1e-14)
    assert weights.sum(axis=0) == pytest.approx(np.ones(3), rel=1e-14)
    assert weights == pytest.approx(STICKY, rel=1e-14)


# --- (10): its limit is a prime, must be r ------------------------------------------------------


# --- (12) and (13): printed in place of a transpose ---------------------------------------------


@pytest.mark.parametrize("model", [NORMAL, MOTION], ids=["velocity", "motion"])
def test_equation_12_without_the_transpose_gives_no_covariance(model: LinearModel) -> None:
    A, Q, P = model.arrays.A, model.arrays.Q, np.eye(model.states)
    printed = A @ P @ A + Q
    asymmetry = np.abs(printed - printed.T).max() / np.abs(printed).max()
    assert asymmetry > 0.5
    assert np.linalg.eigvals(printed).imag.max() > 0.05
    kalman = KalmanFilter(model)
    found = kalman.predict(kalman.init(np.zeros(model.states), P).posterior, [0.0]).covariance
    assert np.array_equal(found, found.T)
    assert found == pytest.approx(A @ P @ A.T + Q, rel=1e-13, abs=1e-15)
    assert np.linalg.eigvalsh(found)[0] > 0


# --- (14): "=" for the minus ---------------------------------------------------------------------


# --- (15): the gain of the SVSF -----------------------------------------------------------------


def printed_gain(e: Array, last: Array, psi: Array, gamma: float) -> Array:
    """Equation (15), with K_{k+1} on its left."""
    saturated = np.clip(e / psi, -1, 1)
    return np.diag((np.abs(e) + gamma * np.abs(last)) * saturated) @ np.linalg.inv(np.diag(e))


def smooth(model: LinearModel, psi: Any, gamma: float = 0.1) -> SmoothVariableStructureFilter:
    return SmoothVariableStructureFilter(model, boundary_layer=psi, convergence_rate=gamma)


def test_equation_15_without_the_pseudo_inverse_needs_as_many_outputs_as_states() -> None:
    e = np.array([0.1, -0.4, 3.0])
    gain = printed_gain(e, np.zeros(3), np.ones(3), 0.1)
    with pytest.raises(ValueError, match="broadcast"):
        np.zeros(5) + gain @ e
    found = smooth(MOTION, 1.0).init(np.zeros(5), 1.0).posterior
    updated = smooth(MOTION, 1.0).correct(found, e, [0.0])
    expected = np.linalg.pinv(MOTION.arrays.C) @ gain @ e
    assert updated.posterior.mean == pytest.approx(expected, rel=1e-13)


def test_equation_15_agrees_with_the_implementation_for_the_identity() -> None:
    psi, last = np.array([0.5, 20.0]), np.array([0.3, -2.0])
    filters, posterior = smooth(FULL, psi), Gaussian(np.zeros(2), np.eye(2), last)
    for e in ([0.2, 3.0], [-4.0, -30.0], [1e-9, 1e9]):
        updated = filters.correct(posterior, e, [0.0])
        gain = printed_gain(np.array(e), last, psi, 0.1)
        assert updated.posterior.mean == pytest.approx(gain @ np.array(e), rel=1e-14)
        vector = (np.abs(e) + 0.1 * np.abs(last)) * np.clip(e / psi, -1, 1)
        assert updated.posterior.mean == pytest.approx(vector, rel=1e-14), "(4) and (5) as well"


@pytest.mark.parametrize("scale", [0.5, 2.0, 3.0])
def test_equation_15_without_the_inverse_contracts_only_for_the_identity(scale: float) -> None:
    # e(k+1|k+1) = (1 - h) e(k+1|k) without gamma: for h = 3 it doubles.
    model = scalar(scale)
    e = np.array([0.7])
    printed = e - scale * printed_gain(e, np.zeros(1), np.array([0.1]), 0.0) @ e
    assert printed == pytest.approx((1 - scale) * e)
    updated = smooth(model, 0.1, 0.0).correct(smooth(model, 0.1).init([0.0], 1.0).posterior, e)
    assert updated.posterior.error == pytest.approx([0.0], abs=1e-15)


def test_innovation_covariance_needs_the_transpose() -> None:
    H, P = np.eye(2, 3), np.diag([1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="mismatch"):
        H @ P @ H
    assert np.array_equal(H @ P @ H.T, np.diag([1.0, 2.0]))


def test_gain_of_equation_15_is_finite_for_a_zero_innovation() -> None:
    with np.errstate(invalid="ignore"), pytest.raises(np.linalg.LinAlgError, match="Singular"):
        printed_gain(np.array([0.0, 1.0]), np.ones(2), np.ones(2), 0.1)
    filters = smooth(FULL, 1.0)
    updated = filters.correct(Gaussian(np.zeros(2), np.eye(2), np.ones(2)), [0.0, 1.0], [0.0])
    assert updated.posterior.mean == pytest.approx([0.0, 1.1])
    assert np.isfinite(updated.posterior.covariance).all()
    near = filters.correct(Gaussian(np.zeros(2), np.eye(2), np.ones(2)), [1e-200, 1.0], [0.0])
    assert near.posterior.covariance == pytest.approx(updated.posterior.covariance, rel=1e-14)


def test_equation_15_with_the_previous_gain_is_one_sample_late() -> None:
    # The left-hand side is K_k, and (16) uses K_{k+1}: with the former a step of the plant meets a
    # gain computed without an error, and none of it is corrected.
    model = scalar()
    filters = smooth(model, 0.5, 0.1)
    e = np.array([2.0])
    before = printed_gain(np.array([1e-6]), np.zeros(1), np.array([0.5]), 0.1)
    assert e - before @ e == pytest.approx(e, rel=1e-5)
    updated = filters.correct(filters.init([0.0], 1.0).posterior, e)
    assert updated.posterior.error == pytest.approx([0.0], abs=1e-15)


# --- (19): a product of vectors over a matrix ---------------------------------------------------


def test_exponent_of_equation_19_must_be_a_quadratic_form() -> None:
    kalman = KalmanFilter(MOTION)
    posterior = kalman.init(np.zeros(5), np.diag([9.0, 0.3, 2e-3, 1e-3, 1e-3])).posterior
    e = np.array([0.02, 0.5, -20.0])
    updated = kalman.correct(posterior, e, [0.0])
    S = updated.innovation_covariance
    with np.errstate(divide="ignore"):
        exponent = -0.5 * (e @ e) / S
    assert exponent.shape == (3, 3), "no likelihood is a number"
    assert not np.isfinite(exponent).all()
    root = np.sqrt(np.linalg.det(2 * np.pi * S))
    assert np.exp(updated.log_likelihood) == pytest.approx(
        np.exp(-0.5 * e @ np.linalg.inv(S) @ e) / root, rel=1e-12
    )


def test_equation_19_agrees_with_the_implementation_for_one_output() -> None:
    kalman = KalmanFilter(NORMAL)
    updated = kalman.correct(kalman.init(np.zeros(4), 0.1).posterior, [0.3], [0.0])
    e, S = updated.innovation[0], updated.innovation_covariance[0, 0]
    printed = np.exp(-0.5 * e * e / S) / np.sqrt(abs(2 * np.pi * S))
    assert np.exp(updated.log_likelihood) == pytest.approx(printed, rel=1e-14)


# --- (20) and (21): c_j is one number c ---------------------------------------------------------


def test_equation_20_divided_by_c_of_each_mode_gives_no_probabilities() -> None:
    # c_j is the letter of (8) too. Over that, mu_j = Lambda_j; over the sum (21), one number for
    # all j, they are probabilities.
    mu, likelihood = np.array([0.6, 0.3, 0.1]), np.array([0.8, 2.5, 7.0])
    c = mu @ STICKY
    printed = likelihood * c / c
    assert printed == pytest.approx(likelihood)
    assert printed.sum() == pytest.approx(10.3)
    log_mu = np.log(c)
    whole = update_probabilities(log_mu, np.log(likelihood))
    assert np.exp(whole) == pytest.approx(likelihood @ c, rel=1e-14)
    assert np.exp(log_mu) == pytest.approx(likelihood * c / (likelihood @ c), rel=1e-14)
    assert np.exp(log_mu).sum() == pytest.approx(1.0, rel=1e-14)


# --- (2) and (14) lack D u ----------------------------------------------------------------------


def test_acceleration_without_feedthrough_is_wrong_by_d_u() -> None:
    u = np.full((1, 1), 1.5)
    z = simulated(MOTION, u)
    without = motion_model("normal", feedthrough=False)
    updated = {}
    for model in (MOTION, without):
        kalman = KalmanFilter(model)
        updated[model] = run_over(kalman, z, u, np.zeros(5), 0.0)["innovation"][0]
    assert np.abs(updated[MOTION]).max() < 1e-12
    assert updated[without] == pytest.approx([0.0, 0.0, 27.03 * 1.5], rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    ("build", "bias"),
    [(KalmanFilter, 0.5033), (lambda model: smooth(model, [0.01, 0.3, 20.0]), 0.0579)],
    ids=["KF", "SVSF"],
)
def test_estimates_without_feedthrough_are_biased(
    build: Callable[[LinearModel], Any], bias: float
) -> None:
    # At rest under u = 1.5 the velocity is 0.9101 * 1.5 and the acceleration zero.
    u = np.full((600, 1), 1.5)
    z = simulated(MOTION, u)
    velocity = []
    for model in (MOTION, motion_model("normal", feedthrough=False)):
        run = run_over(build(model), z, u, np.zeros(5), 0.01)
        velocity.append(run["state"][:, 1])
    assert velocity[0] == pytest.approx(z[:, 1], abs=1e-9)
    assert velocity[0][-1] == pytest.approx(0.9101 * 1.5, rel=1e-4)
    assert velocity[1][-1] - z[-1, 1] == pytest.approx(bias, rel=1e-3)


def test_kalman_bias_agrees_with_the_steady_gain() -> None:
    # The position grows without bound, so the error moves: e+ = (I - K H)(A e) - K D u in steady
    # state.
    A, _, H, D, Q, R = MOTION.arrays
    P = solve_discrete_are(A.T, H.T, Q, R)
    K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    error = np.linalg.solve(np.eye(5) - (np.eye(5) - K @ H) @ A, K @ D @ [1.5])
    assert error[1] == pytest.approx(0.5033, rel=1e-3)


def test_bank_without_feedthrough_diagnoses_the_normal_actuator_as_faulty() -> None:
    # The missing term is h1 u: 27.03 for the normal actuator, 2.34 for the leaky one. The input of
    # the previous step is in the measurements, which are left limits.
    wave = square_wave(200, 20)
    u = np.hstack([wave, np.vstack([wave[:1], wave[:-1]])])
    noise = np.array([0.01, 0.2, 8.0]) * ripple(200, 3)
    z = simulated(left_limit(MOTION), u) + noise
    found = []
    for feedthrough in (True, False):
        modes = ("normal", "friction", "leakage")
        models = [left_limit(motion_model(mode, feedthrough)) for mode in modes]
        bank = IMM([KalmanFilter(replace(model, R=[1e-4, 0.04, 64.0])) for model in models], STICKY)
        run = run_over(bank, z, u, np.zeros(5), 0.01)
        found.append(run["probability"][50:, 0].mean())
    assert found[0] > 0.98
    assert found[1] < 0.02


# --- Section II.B: two models -------------------------------------------------------------------


def test_two_models_leave_the_third_without_a_probability() -> None:
    """The leak has none of its own in a bank of the other two, which share 1 between them."""
    wave = square_wave(200, 20)
    u = np.hstack([wave, np.vstack([wave[:1], wave[:-1]])])
    z = simulated(left_limit(motion_model("leakage")), u)
    z += np.array([0.01, 0.2, 8.0]) * ripple(200, 3)
    found = {}
    for modes in (("normal", "friction"), ("normal", "friction", "leakage")):
        models = [replace(left_limit(motion_model(mode)), R=[1e-4, 0.04, 64.0]) for mode in modes]
        r = len(modes)
        transition = 0.023 * np.ones((r, r)) + (1 - 0.023 * r) * np.eye(r)
        bank = IMM([KalmanFilter(model) for model in models], transition)
        run = run_over(bank, z, u, np.zeros(5), 0.01)
        found[r] = run["probability"][50:].mean(axis=0)
    assert found[2].sum() == pytest.approx(1.0), "all of it given to models that do not apply"
    assert found[3][2] > 0.5, "the most probable of three"


# --- (7): the index of the sum is a superscript, and its name belongs to another quantity -------


def test_equation_7_is_not_a_predicted_mode_probability() -> None:
    # The chain predicts c_j of (8): one number per mode, which sum to one.
    weights, c = mixing(STICKY, MU)
    assert c == pytest.approx(MU @ STICKY)
    assert c.sum() == pytest.approx(1.0)
    assert weights.sum() == pytest.approx(3.0), "(7): where a mode may have come from, r densities"
    assert np.abs(weights.sum(axis=1) - c).min() > 0.04


# --- Nomenclature: j is both the number of filters and the index of one -------------------------


def test_index_j_as_number_of_filters_gives_one_sum_for_all_modes() -> None:
    weights, c = mixing(STICKY, MU)
    number = 3
    printed = STICKY * MU[:, None] / (STICKY[:number, number - 1] @ MU[:number])
    assert printed[:, -1] == pytest.approx(weights[:, -1])
    assert printed.sum(axis=0) == pytest.approx(c / c[-1])
    assert printed.sum(axis=0)[0] > 5


# --- Fig. 8's caption: an increased layer -------------------------------------------------------


def test_increased_layer_does_not_reproduce_fig_8() -> None:
    quoted = 0.8
    for factor, agrees in ((0.01, True), (100.0, False)):
        changes = {"observers": {"svsf_thin_tuned": {"layer_factor": factor}}}
        figure = evaluate(fixed_parameters("imm", changes, SEED), "fig8")
        leakage = lookup(figure.numbers)["svsf_thin_tuned", "leakage_after"]
        assert (abs(leakage - quoted) < 0.1) == agrees, leakage
