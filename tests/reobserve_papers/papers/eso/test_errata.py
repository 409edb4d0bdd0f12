"""Errors and overstated claims in Indriawati, Agustinah & Jazidie, with numbers.

The observer with the printed F, the insufficient condition on (A, C), the printed back
electromotive force in A and the sign of the integral are covered by the tests of observer, system
and plant.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad_vec
from scipy.linalg import expm, solve_continuous_are, solve_continuous_lyapunov

from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve.synthesis.extended_state import pd_pi, pi
from reobserve.synthesis.extended_state.certificate import error_system
from reobserve.synthesis.extended_state.design import CertifiedGains
from reobserve.synthesis.extended_state.gamma_bound import gamma_lower_bound
from reobserve.synthesis.extended_state.inequality import PdPiVariables
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.synthesis.h_infinity_norm import h_infinity_norm
from tests.reobserve.synthesis.plants import dc_motor

Array = NDArray[np.float64]

SYSTEM = dc_motor()
FLOOR = 1.00503781018428


@cache
def optimised() -> CertifiedGains:
    return pd_pi.design(SYSTEM)


@cache
def designs() -> dict[str, tuple[AugmentedSystem, Gains]]:
    """Observers of all kinds, and two filters."""
    fast = dc_motor(Az=10.0)
    return {
        "PI, feasible": (SYSTEM, pi.design_feasible(SYSTEM, 1.0).gains),
        "PI, feasible, fast filter": (fast, pi.design_feasible(fast, 2.0).gains),
        "PI, minimum norm": (SYSTEM, pi.design(SYSTEM).gains),
        "PD/PI, minimum norm": (SYSTEM, optimised().gains),
        "PD/PI, minimum gamma": (SYSTEM, pd_pi.design_minimum_gamma(SYSTEM, 0.0, 50.0).gains),
    }


KINDS = (
    "PI, feasible",
    "PI, feasible, fast filter",
    "PI, minimum norm",
    "PD/PI, minimum norm",
    "PD/PI, minimum gamma",
)


def at_rest(model: AugmentedSystem, gains: Gains, y: Array, u: float) -> Array:
    """x, fa and fs after 40 s, estimated by an observer with this model of the plant."""
    observer = ExtendedStateObserver(model, gains=gains, sampling_period=0.05)
    run = observer.run(np.tile(y, (800, 1)), np.full((800, 1), u))
    return np.hstack([run["state"][-1], run["actuator_fault"][-1], run["sensor_fault"][-1]])


# --- F: (3) says + Az Fs, (4) and (7) print - ----------------------------------------------------


def test_equation_3_adds_the_sensor_fault_and_equation_4_subtracts_it() -> None:
    # Speed 1 and fs = 0.1: the filter of y = 1.1 ends at 1.1; by (4) it ends at 0.9.
    x, fault = np.array([1.0, 10.0]), np.array([0.0, 0.1])
    printed = dc_motor(Fs=-SYSTEM.Fs)
    ends = [
        np.linalg.solve(system.Aa[2:, 2:], -system.Aa[2:, :2] @ x - system.F[2:] @ fault)
        for system in (SYSTEM, printed)
    ]
    assert ends[0] == pytest.approx([1.1, 10.0], rel=1e-14)
    assert ends[1] == pytest.approx([0.9, 10.0], rel=1e-14)


def test_gains_for_the_printed_f_estimate_minus_the_fault_at_the_same_gamma() -> None:
    printed = dc_motor(Fs=-SYSTEM.Fs)
    found = pd_pi.design(printed)
    assert found.gamma == pytest.approx(optimised().gamma, rel=1e-13)
    assert found.certificate.norm_upper == pytest.approx(1.0546816, rel=1e-6)
    y = np.array([1.1, 9.99])
    truth = at_rest(SYSTEM, optimised().gains, y, 10.0)
    assert truth[3] == pytest.approx(0.101, abs=1e-9)
    assert at_rest(printed, found.gains, y, 10.0)[3] == pytest.approx(-0.101, abs=1e-7)


def test_errors_double_every_quarter_second_with_gains_for_the_other_sign() -> None:
    Ao, Eo = error_system(dc_motor(Fs=-SYSTEM.Fs), optimised().gains)
    fastest = np.linalg.eigvals(np.linalg.solve(Eo, Ao)).real.max()
    assert fastest == pytest.approx(3.019, abs=1e-3)
    assert np.log(2) / fastest < 0.25


# --- The plant of Section IV ---------------------------------------------------------------------


def test_observer_with_the_printed_back_emf_estimates_speed_as_a_fault() -> None:
    # In steady state fa^ - fa = -0.02 x1, a tenth of the fault of 0.2 per rad/s; gamma is the same.
    printed = dc_motor(A=[[-10.0, 1.0], [0.02, -2.0]])
    x = np.linalg.solve(-SYSTEM.A, [0.0, 2 * (10.0 + 0.2)])
    assert x[0] == pytest.approx(1.02 / 1.001, rel=1e-12)
    gains = optimised().gains
    assert at_rest(SYSTEM, gains, x, 10.0) == pytest.approx([*x, 0.2, 0.0], abs=1e-9)
    found = at_rest(printed, gains, x, 10.0)
    assert found == pytest.approx([*x, 0.2 - 0.02 * x[0], 0.0], abs=1e-9)
    assert gamma_lower_bound(printed) == pytest.approx(FLOOR, rel=1e-13)


# --- (22) and (24): the input of the dual is not dD ---------------------------------------------


def test_dual_has_one_input_more_than_dD() -> None:
    Ao, Eo = error_system(SYSTEM, optimised().gains)
    assert SYSTEM.Bo.shape == (6, 5), "yz of (23) is what has the dimension of dD"
    # Transfer matrices of (10) and of the dual, with the identity for the input, are transposed.
    for s in (0.0, 0.7j, 1.0 + 3.0j):
        primal = np.linalg.solve(s * Eo - Ao, SYSTEM.Bo)
        dual = SYSTEM.Bo.T @ np.linalg.solve(s * Eo.T - Ao.T, np.eye(6))
        assert dual == pytest.approx(primal.T, abs=1e-12)
    norm = h_infinity_norm(Ao.T, np.eye(6), SYSTEM.Bo.T, E=Eo.T).upper
    assert norm == pytest.approx(optimised().certificate.norm_upper, rel=1e-10)


def test_dual_with_dD_entering_through_bo_has_another_norm() -> None:
    Ao, Eo = error_system(SYSTEM, optimised().gains)
    read = h_infinity_norm(Ao.T, SYSTEM.Bo, SYSTEM.Bo.T, E=Eo.T).upper
    assert read == pytest.approx(1.06078, abs=1e-4)
    assert optimised().gamma is not None
    assert read > optimised().gamma > optimised().certificate.norm_upper


# --- Theorem 1: definite P2, P3 and nonsingular Y1, Y2 -------------------------------------------


def test_inequality_19_forbids_positive_definite_p2_and_does_not_constrain_y2() -> None:
    # A solution of (19) from the Riccati equation of the bounded real lemma of a PI observer.
    gains, gamma, N = pi.design(SYSTEM).gains, 1.2, SYSTEM.size
    Ao = SYSTEM.A_tilde - gains.L @ SYSTEM.C_tilde
    slack = 1.01 * np.eye(N) / gamma
    P1 = solve_continuous_are(Ao, SYSTEM.Bo, slack, -gamma * np.eye(5))
    found = PdPiVariables(P1, Ao.T @ P1, np.eye(N) / gamma, gains.L.T @ P1, np.zeros((2, N)))
    assert np.linalg.eigvalsh(np.block(found.blocks(SYSTEM, gamma)))[-1] < -1e-4
    assert np.linalg.eigvalsh(P1)[0] > 0
    # The first block is P2 + P2^T: a definite P2 makes it positive.
    assert np.linalg.eigvalsh(found.P2 + found.P2.T)[-1] < 0
    for Y, rank in ((found.Y1, 2), (found.Y2, 0)):
        assert Y.shape == (2, 6), "h = p, so not square"
        assert np.linalg.matrix_rank(Y) == rank
    np.testing.assert_allclose(found.gains().L, gains.L, rtol=1e-8, atol=1e-8)


# --- Section IV: disturbances from -0.2 -0.1 to -0.2 0.1 -----------------------------------------


def exact_errors() -> list[list[Fraction]]:
    """Errors of speed, current, fa and fs under constant d1, d2 and w, for any gains.

    The measured error vanishes: 0 = A ex + B efa + Dd d and 0 = ex + [w + efs, 0].
    """
    columns = []
    for d1, d2, w in np.eye(3, dtype=int).tolist():
        speed = Fraction(d1, 10)  # -10 speed + current + d1 = 0 with a current of 0
        fa = Fraction(2, 100) * speed / 2 - d2  # -0.02 speed + 2 fa + 2 d2 = 0
        columns.append([speed, Fraction(0), fa, -speed - w])
    return [list(row) for row in zip(*columns, strict=True)]


@pytest.mark.parametrize("kind", KINDS)
def test_errors_under_constant_disturbances_do_not_depend_on_the_gains(kind: str) -> None:
    system, gains = designs()[kind]
    Ao, _ = error_system(system, gains)
    gain = -np.linalg.solve(Ao, system.Bo)[[0, 1, 4, 5], :3]
    exact = exact_errors()
    assert exact[2] == [Fraction(1, 1000), -1, 0]
    assert exact[3] == [Fraction(-1, 10), 0, -1]
    assert gain == pytest.approx(np.array(exact, dtype=float), abs=1e-9)


# Means of d1 and d2 as printed, and the biases fa^ - fa and fs^ - fs.
READINGS = {
    "[min of d1, min of d2] and [max, max]": ((-0.2, 0.0), (2e-4, -0.02)),
    "[min of d1, max of d1] and [min, max]": ((-0.15, -0.05), (-0.04985, -0.015)),
    "+-0.2 and +-0.1": ((0.0, 0.0), (0.0, 0.0)),
}


@pytest.mark.parametrize("reading", READINGS)
@pytest.mark.parametrize("kind", KINDS)
def test_printed_disturbances_bias_every_observer(kind: str, reading: str) -> None:
    (d1, d2), bias = READINGS[reading]
    system, gains = designs()[kind]
    speed, current = np.linalg.solve(-SYSTEM.A, [d1, 2 * (10.0 + 0.2) + 2 * d2])
    found = at_rest(system, gains, np.array([speed + 0.1, current]), 10.0)
    assert found[2:] - [0.2, 0.1] == pytest.approx(bias, abs=1e-9)
    if reading.startswith("[min of d1, min"):
        assert abs(found[3] - 0.1) == pytest.approx(0.2 * 0.1, rel=1e-6), "a fifth of the fault"


# --- "There is no constraint imposed on the faults": dD contains f' ------------------------------


def sizes_of_a_ramp(column: int, duration: float) -> tuple[float, float, float]:
    """L2 norms of f' and of e for a fault that rises linearly to 1, and e at its end."""
    Ao, Eo = error_system(SYSTEM, optimised().gains)
    A, b = np.linalg.solve(Eo, Ao), np.linalg.solve(Eo, SYSTEM.Bo[:, column])

    def error(t: float) -> Array:
        return np.asarray(np.linalg.solve(A, (expm(A * t) - np.eye(6)) @ b) / duration)

    rising, _ = quad_vec(lambda t: error(t) @ error(t), 0, duration, epsrel=1e-9)
    last = error(duration)
    after = last @ solve_continuous_lyapunov(A.T, -np.eye(6)) @ last
    return 1 / np.sqrt(duration), float(np.sqrt(rising + after)), float(last[column + 1])


@pytest.mark.parametrize(
    ("column", "limit"), [(3, 0.500588), (4, 0.408435)], ids=["actuator", "sensor"]
)
def test_norm_gives_no_bound_for_a_jumping_fault(column: int, limit: float) -> None:
    durations = (10.0, 1.0, 0.1, 0.01, 1e-3)
    rates, errors, ends = np.array([sizes_of_a_ramp(column, each) for each in durations]).T
    gamma = optimised().certificate.norm_upper
    assert np.all(errors <= gamma * rates)
    assert rates[-1] > 30
    # ||f'|| grows without bound and ||e|| tends to that of an initial error of 1.
    assert np.diff(np.log10(rates)) == pytest.approx(np.full(4, 0.5), rel=1e-12)
    assert errors[-1] == pytest.approx(limit, rel=1e-3)
    assert errors[-1] / rates[-1] < 0.02 < gamma
    # Right after a jump the estimate misses all of it, for any gains.
    assert ends[-1] == pytest.approx(1.0, abs=1e-3)
    assert errors[0] / rates[0] > 0.3


def test_estimate_is_unchanged_immediately_after_a_jump() -> None:
    observer = ExtendedStateObserver(SYSTEM, gains=optimised().gains, sampling_period=1e-6)
    y = np.tile([1.0, 0.0], (2, 1))  # fs = 1 from now on
    found = observer.run(y, np.zeros((2, 1)))
    assert np.abs(found["sensor_fault"]).max() < 1e-4


# --- (3), (6), (7): the place of Az --------------------------------------------------------------


def observed_by_6(gains: Gains, rate: float, s: complex) -> Array:
    """fa^ and fs^ for u, fa and fs, one column each: (6) with Aa and F of (7), and (3)."""
    plant, model = dc_motor(Az=rate), SYSTEM
    assert np.array_equal(model.Az, np.eye(2))
    together, entering = np.zeros((10, 10)), np.zeros((10, 3))
    together[:4, :4], entering[:4] = plant.Aa, np.hstack([plant.Ba, plant.F])
    together[4:, 2:4] = gains.L
    together[4:, 4:], entering[4:8, :1] = model.A_tilde - gains.L @ model.C_tilde, model.Ba
    return np.asarray(np.linalg.solve(s * np.eye(10) - together, entering)[-2:])


def test_control_leaks_into_the_actuator_fault_without_az_in_6() -> None:
    """Constant faults are still found: in steady state Aa and F have the same error."""
    gains = pi.design_feasible(SYSTEM, 1.0).gains
    at_rest = observed_by_6(gains, 10.0, 0.0)
    assert at_rest == pytest.approx(np.array([[0, 1, 0], [0, 0, 1]]), abs=1e-9)
    moving = np.abs(observed_by_6(gains, 10.0, 1j)[0, 0])
    assert moving == pytest.approx(0.81, abs=0.005)
    # With the identity as filter, too, it is the intended observer.
    assert np.abs(observed_by_6(gains, 1.0, 1j)[:, 0]).max() < 1e-12


def test_gamma_without_az_in_dw_is_not_achievable() -> None:
    unscaled = dc_motor(Az=10.0, Dw=SYSTEM.Dw / 10)
    assert unscaled.Da[2, 2] == 1.0
    # Errors under constant d1, d2, w: w counts as a tenth.
    errors = [[0.1, 0, 0], [0.001, -1, 0], [-0.1, 0, -0.1]]
    assert gamma_lower_bound(unscaled) == pytest.approx(np.linalg.norm(errors, 2), rel=1e-12)
    assert gamma_lower_bound(unscaled) < 1.000001 < FLOOR
    found = pd_pi.design(unscaled, gamma=1.004)
    assert found.certificate.holds
    Ao, Eo = error_system(dc_motor(Az=10.0), found.gains)
    norm = h_infinity_norm(Ao, dc_motor(Az=10.0).Bo, np.eye(6), E=Eo)
    assert norm.lower > FLOOR > 1.004
