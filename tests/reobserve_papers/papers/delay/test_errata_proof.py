"""Errors in the printed model, proof and settings, and what fails with them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from reobserve.observers.levant import LevantDifferentiator
from reobserve.synthesis.high_gain_design import high_gain, lyapunov_matrix
from reobserve_papers.papers.delay.theory_gains import steady_ramp_error
from tests.reobserve.observers.small_plants import G_OVER_L, GAIN, A
from tests.reobserve_papers.papers.delay.test_errata import delay_error, seconds
from tests.reobserve_papers.papers.delay.test_proofs import bound, remainder
from tests.reobserve_papers.plants.test_delayed_plants import PENDULUM, RAMP, SINE

Array = NDArray[np.float64]


def scaling(size: int, xi: float) -> Array:
    """lambda(xi)."""
    return np.diag([*np.ones(size - 1), xi])


def shrinking(size: int, rho: float) -> Array:
    """Delta_rho of (22)."""
    return np.diag(rho ** -np.arange(size, dtype=np.float64))


def extended(size: int, xi: float) -> Array:
    """Lambda_ext(xi)."""
    matrix = np.eye(size, k=1)
    matrix[-2, -1] = xi
    return matrix


# --- The model and the expansion ----------------------------------------------------------------


def test_output_row_is_printed_as_a_column() -> None:
    x, column = np.array([0.3, -1.0]), np.array([[1.0], [0.0]])
    with pytest.raises(ValueError, match="mismatch"):
        column @ x
    assert (column.T @ x).tolist() == [0.3]
    # C^T C of (9) would be a number, and the Lyapunov equation no matrix equation.
    assert (column.T @ column).shape == (1, 1)
    S, shift = lyapunov_matrix(2, 2.5), np.eye(2, k=1)
    residual = 2.5 * S + shift.T @ S + S @ shift - column @ column.T
    assert np.max(np.abs(residual)) < 1e-15


def test_printed_blocks_of_lambda_do_not_fit() -> None:
    n = 3
    zeros, unit = np.zeros, np.eye(n - 1)
    with pytest.raises(ValueError, match="dimensions"):
        np.block([[zeros((n, 1)), unit], [zeros((1, 1)), zeros((1, n))]])
    corrected = np.block([[zeros((n - 1, 1)), unit], [zeros((1, 1)), zeros((1, n - 1))]])
    assert np.array_equal(corrected, np.eye(n, k=1))


def test_bounded_rate_is_not_what_assumption_5_needs() -> None:
    """u = sin t has a bounded rate that is zero; that of u = exp t fulfils (5) unbounded."""
    time, bound = np.linspace(0, 10, 1001), 0.5
    assert np.max(np.abs(np.cos(time))) <= 1
    assert np.min(np.abs(np.cos(time))) < bound
    # Where the rate is zero, the last entry of lambda and with it the determinant is.
    assert np.linalg.det(scaling(3, GAIN * np.cos(np.pi / 2))) == pytest.approx(0, abs=1e-14)
    assert np.min(np.exp(time)) > bound
    assert np.exp(10) > 1e4 * bound


def test_rank_is_deficient_without_the_first_output_derivative() -> None:
    """For n = 2 the printed list j = 2..n-1 is empty: y and y'' remain for three unknowns."""
    xi = GAIN * 0.2
    rows = {"y": [1, 0, 0], "y'": [0, 1, 0], "y''": [-G_OVER_L, -A, xi]}
    printed = np.array([rows["y"], rows["y''"]])
    assert np.linalg.matrix_rank(printed) == 2
    assert np.linalg.matrix_rank(np.array(list(rows.values()))) == 3


def test_pendulum_drift_has_two_rows() -> None:
    """The printed F is one number; f of (1) has one per state, the first of them zero."""
    f, x = np.empty(2), np.array([0.3, -1.0])
    PENDULUM.model.drift(x, PENDULUM.model.parameters, f)
    assert f.tolist() == pytest.approx([0.0, -G_OVER_L * np.sin(0.3) + A])


def test_expansion_needs_an_undefined_input_before_t_0() -> None:
    """u is given from -tau_max on, so u(t - tau) is from t = 0 on and not from -tau_max."""
    early, later = np.array([-1.0]), np.array([0.0])
    for order in (1, 2):
        assert abs(remainder(RAMP, order, later, 1.5)[0]) < 1e-15
        assert abs(remainder(RAMP, order, early, 1.5)[0]) > 0.01 > bound(order, 1.5, 0.0)


def test_remainder_depends_on_more_than_the_delayed_time() -> None:
    """(32) prints gamma'_m(t - tau); here t - tau is 4 s in both."""
    one, other = (remainder(SINE, 2, np.array([4.0 + tau]), tau)[0] for tau in (0.5, 1.5))
    assert abs(other) > 10 * abs(one) > 0


# --- The proof of Theorem 2 ---------------------------------------------------------------------


@pytest.mark.parametrize("size", [2, 3, 4])
def test_change_of_coordinates_needs_the_other_decomposition(size: int) -> None:
    """(17) pairs Lambda_ext with e; lambda(xi^) makes A of Lambda_ext(xi^) only, as in (23)."""
    estimated, true = 4.0, 2.5
    into, back = scaling(size, estimated), scaling(size, 1 / estimated)
    shift = np.eye(size, k=1)
    assert np.array_equal(into @ extended(size, estimated) @ back, shift)
    gap = into @ extended(size, true) @ back - shift
    assert np.max(np.abs(gap)) == pytest.approx(abs(true / estimated - 1))
    # Both decompositions are correct by themselves.
    rng = np.random.default_rng(5)
    estimate, state = rng.normal(size=(2, size))
    whole = extended(size, estimated) @ estimate - extended(size, true) @ state
    change, error = extended(size, estimated) - extended(size, true), estimate - state
    assert change @ estimate + extended(size, true) @ error == pytest.approx(whole)
    assert change @ state + extended(size, estimated) @ error == pytest.approx(whole)


@pytest.mark.parametrize("order", [1, 2])
def test_error_system_holds_with_the_delay_in_gamma(order: int) -> None:
    """Equation (14) with numbers: (21) and (23) have an undefined h in place of tau."""
    t, tau, other, rate, rho = 70.0, 0.9, 0.4, 0.09, 2.5
    x, estimate = np.array([0.4, -0.7, tau]), np.array([0.5, -0.3, 1.2])
    u = [np.sin(0.2 * t), 0.2 * np.cos(0.2 * t), -0.04 * np.sin(0.2 * t)]

    def xi(delay: float) -> float:
        return GAIN * (-u[1] + (0.5 * delay * u[2] if order == 2 else 0.0))

    def drift(x: Array) -> Array:
        return np.array([0.0, -G_OVER_L * np.sin(x[0]) - A * x[1], 0.0])

    forced = np.array([0.0, GAIN, 0.0])
    gain = np.linalg.solve(scaling(3, xi(1.2)), high_gain(3, rho))
    true = extended(3, 0.0) @ x + drift(x) + forced * np.sin(0.2 * (t - tau)) + [0, 0, rate]
    found = extended(3, xi(1.2)) @ estimate + drift(estimate) + forced * u[0]
    found -= gain * (estimate[0] - x[0])
    for delay, holds in ((tau, True), (other, False)):
        gamma = forced * remainder(SINE, order, np.array([t]), delay)[0] + [0, 0, rate]
        system = extended(3, xi(1.2)) @ estimate - extended(3, xi(tau)) @ x
        system += drift(estimate) - drift(x) - gain * (estimate[0] - x[0]) - gamma
        assert np.allclose(found - true, system, rtol=0, atol=1e-12) == holds


def test_mean_value_theorem_has_no_single_point_for_vector_functions() -> None:
    """f = (sin x1, cos x1) is Lipschitz and lower-triangular; (20) needs a single kappa."""
    start, end = 0.0, 2 * np.pi
    change = np.array([np.sin(end) - np.sin(start), np.cos(end) - np.cos(start)])
    assert np.max(np.abs(change)) < 1e-15
    kappa = np.linspace(start, end, 1001)
    slopes = np.stack([np.cos(kappa), -np.sin(kappa)])
    assert np.min(np.linalg.norm(slopes, axis=0)) == pytest.approx(1.0)
    # The mean of the Jacobian over the segment is correct.
    assert np.max(np.abs(slopes[:, :-1].mean(axis=1) * (end - start) - change)) < 1e-12


def test_expansion_bound_lacks_a_factor_rho_for_one_state() -> None:
    """(26) prints c0 / rho for all n; row n is scaled by rho^(1-n), so for (39) it is c0."""
    rho, c0 = 5.0, 0.7
    for n in (1, 2, 3):
        product = np.zeros(n + 1)
        product[n - 1] = c0
        size = np.linalg.norm(scaling(n + 1, 0.2) @ shrinking(n + 1, rho) @ product)
        assert size == pytest.approx(c0 / rho ** (n - 1))
        assert (size <= c0 / rho * (1 + 1e-12)) == (n > 1)


def test_scaling_is_below_one_only_for_large_gains() -> None:
    """||lambda Delta|| <= 1 needs rho^n >= |xi|, not rho >= 1; xi of Fig. 2 is up to 4."""
    xi = GAIN * 0.2
    assert xi == pytest.approx(4)
    size = {rho: np.linalg.norm(scaling(3, xi) @ shrinking(3, rho), 2) for rho in (1, 1.5, 2, 2.5)}
    assert size[1] == pytest.approx(4)
    assert size[1.5] == pytest.approx(4 / 2.25)
    assert size[2] == size[2.5] == pytest.approx(1)


def test_jacobian_constant_differs_from_the_expansion_constant() -> None:
    """Before (25) it is called c0, as in (19), where zero suffices for m = 1."""
    rng = np.random.default_rng(6)
    (true, estimate), rate = rng.uniform(0, 1.5, (2, 100)), 0.2
    # (18) for m = 1: the powers of the delays are of order zero and cancel.
    assert np.max(np.abs(estimate * GAIN * rate * (estimate**0 - true**0))) == 0
    jacobian = np.zeros((3, 3))
    jacobian[1, :2] = -G_OVER_L, -A
    for rho in (1.0, 5.0):
        scaled = shrinking(3, rho) @ jacobian @ np.linalg.inv(shrinking(3, rho))
        assert np.linalg.norm(scaled, 2) == pytest.approx(np.hypot(G_OVER_L / rho, A))


def test_proof_needs_a_rho_far_above_those_of_the_figures() -> None:
    """c3 > 0 with c1 the norm of (24) at the hanging pendulum and a constant xi, so that nu = 0."""
    spread = np.linalg.eigvalsh(lyapunov_matrix(3, 1.0))

    def c3(rho: float) -> float:
        c1 = np.hypot(G_OVER_L / rho, A)
        return float((rho * spread[0] - 2 * c1 * spread[-1]) / spread[-1])

    assert brentq(c3, 1, 1e4) == pytest.approx(186.4, rel=1e-3)


def test_proof_radius_falls_with_rho_only_if_the_disturbance_is_scaled() -> None:
    """r of (31), back from the scaled error by rho^n / alpha: in proportion to rho for n = 2.

    With the constants of the ramp: xi = 0.18 = alpha, nu = 0, c0 = 0 for m = 1, Gamma = 0.09. If
    lambda Delta_rho Gamma of (23) is not bounded by Gamma, r is in proportion to 1 / rho instead.
    """
    spread, xi = np.linalg.eigvalsh(lyapunov_matrix(3, 1.0)), GAIN * 0.009

    def radius(rho: float, disturbance: float) -> float:
        c3 = (rho * spread[0] - 2 * np.hypot(G_OVER_L, A) * spread[-1]) / spread[-1]
        c4 = 2 * spread[-1] * disturbance / np.sqrt(spread[0])
        return float(rho**2 / xi * c4 / c3 / np.sqrt(spread[0]))

    rhos = (1e4, 2e4, 4e4)
    printed = [radius(rho, 0.09) for rho in rhos]
    assert np.divide(printed[1:], printed[:-1]) == pytest.approx(2, rel=0.3)
    scaled = [radius(rho, xi * 0.09 / rho**2) for rho in rhos]
    assert np.divide(scaled[1:], scaled[:-1]) == pytest.approx(0.5, rel=0.3)


def test_delay_jump_violates_the_bound_of_theorem_2() -> None:
    """The list of Theorem 2 leaves out Assumption 3, without which eta has no bound.

    All that is listed holds on the ramp, and the error does not return to the ball that it has
    reached: it leaves it by the jump of the delay.
    """
    error = np.abs(delay_error("ramp", 5.0, 2, 0.0, 106.0))
    settled = np.max(seconds(error, 15, 20))
    assert settled < 1e-7
    assert np.max(seconds(error, 20, 21)) == pytest.approx(0.6, abs=0.01)
    assert np.max(seconds(error, 80, 105)) < 0.08  # where the delay satisfies the assumption


# --- Contradictory settings ----------------------------------------------------------------------


@pytest.mark.parametrize("rho", [2.5, 5.0])
def test_initial_matrix_of_table_1_does_not_solve_the_printed_equation(rho: float) -> None:
    """Equation (34) is algebraic and has one solution; S(0) = I requires a differential
    equation."""
    shift, first = np.eye(3, k=1), np.diag([1.0, 0.0, 0.0])

    def residual(S: Array) -> float:
        return float(np.max(np.abs(rho * S + shift.T @ S + S @ shift - first)))

    assert residual(lyapunov_matrix(3, rho)) < 1e-13
    assert residual(np.eye(3)) >= 1.0


def test_rho_of_text_and_caption_differ() -> None:
    """Section 4.1 and Table I give 5 to both observers, the caption of Fig. 2 has 2.5."""
    hanging = {rho: abs(steady_ramp_error(rho, G_OVER_L, A)) for rho in (2.5, 5.0)}
    assert hanging[5.0] == pytest.approx((22.5 + 75 + 19.62) / 125)
    assert hanging[2.5] == pytest.approx((11.25 + 18.75 + 19.62) / 15.625)
    assert hanging[2.5] > 3 * hanging[5.0]
    # As in Fig. 2, without noise: only with 5 the error of m = 1 has a peak at u' = 0, 70.7 s.
    for rho, ratio in ((2.5, 1.04), (5.0, 4.3)):
        error = np.abs(delay_error("sine", rho, 1, 0.7, 86.0))
        peak, lag = (np.max(seconds(error, *span)) for span in ((67, 75), (79, 86)))
        assert peak / lag == pytest.approx(ratio, rel=0.03)


def test_differentiator_of_sliding_order_two_has_no_second_derivative() -> None:
    """That of 1993; (37) needs z2, and is the second member of the family of 2003."""
    time = np.arange(0.0, 60.0, 1e-3)
    for order, lambdas in ((1, (1.5, 1.0)), (2, (3.0, 1.5, 1.0))):
        law = LevantDifferentiator(L=0.11, order=order, lambdas=lambdas, sampling_period=1e-3)
        found = law.run(np.sin(0.2 * time), start=law.init(np.zeros(order + 1)))["derivatives"]
        assert found.shape[1] == order + 1
        assert found[-1, 1] == pytest.approx(0.2 * np.cos(12.0), abs=2e-3)
    assert found[-1, 2] == pytest.approx(-0.04 * np.sin(12.0), abs=2e-3)
