"""Certificates: what they prove, and cases in which a solver wrongly reports "optimal"."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import cvxpy
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_lyapunov

from reobserve.core.errors import InputError
from reobserve.synthesis.extended_state import pd_pi, pi
from reobserve.synthesis.extended_state.certificate import certify, error_system
from reobserve.synthesis.extended_state.design import accepted
from reobserve.synthesis.extended_state.gamma_bound import gamma_lower_bound
from reobserve.synthesis.extended_state.inequality import PdPiVariables, PiVariables, mapped
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from tests.reobserve.synthesis.plants import dc_motor, random_plant

Array = NDArray[np.float64]

MOTOR = dc_motor()
N = MOTOR.size


def unknowns() -> PdPiVariables:
    square, flat = (N, N), (2, N)
    shapes = (square, square, flat, flat)
    P1 = cvxpy.Variable(square, symmetric=True)
    return PdPiVariables(P1, *(cvxpy.Variable(shape) for shape in shapes))


def minimised(
    objective: Any, variables: PdPiVariables, gamma: Any, *constraints: Any, **options: Any
) -> tuple[str, PdPiVariables]:
    """The result of a solver for (19) with another objective."""
    left = cvxpy.bmat(variables.blocks(MOTOR, gamma))
    problem = cvxpy.Problem(cvxpy.Minimize(objective), [left << 0, *constraints])
    problem.solve(**options)
    return problem.status, mapped(variables, lambda matrix: np.array(matrix.value))


@cache
def good() -> tuple[float, PdPiVariables]:
    """A strict solution of (19) at 1.2 times the lower bound."""
    v, gamma = unknowns(), 1.2 * gamma_lower_bound(MOTOR)
    squares = sum(cvxpy.sum_squares(m) for m in (v.P1, v.P2, v.P3, v.Y1, v.Y2))
    bounds = [v.P1 >> 0.02 * np.eye(N), v.P3 + v.P3.T >> 0.04 * np.eye(N)]
    status, found = minimised(squares, v, 0.99 * gamma, *bounds, solver="CLARABEL")
    assert status == "optimal"
    return gamma, found


def test_valid_design_is_certified() -> None:
    gamma, found = good()
    certificate = certify(MOTOR, found.gains(), gamma, found)
    assert certificate.holds
    assert certificate.floor < certificate.norm_lower <= certificate.norm_upper < gamma


def test_norm_agrees_with_a_frequency_sweep() -> None:
    gains = good()[1].gains()
    Ao, Eo = error_system(MOTOR, gains)
    frequency = np.concatenate([[0.0], np.geomspace(1e-3, 1e3, 20001)])
    pencil = 1j * frequency[:, None, None] * Eo - Ao
    swept = np.linalg.norm(np.linalg.solve(pencil, MOTOR.Bo), 2, axis=(1, 2)).max()
    assert certify(MOTOR, gains).norm_upper == pytest.approx(swept, rel=1e-9)


def test_poles_are_those_of_the_error_system_slowest_first() -> None:
    """x' = -x, y = x + fs: with Lx = 0 the plant's own, and those of s^2 + 6 s + 8."""
    none = np.zeros((1, 0))
    system = dc_motor(A=[[-1.0]], B=none, C=[[1.0]], Dd=[[1.0]], Dw=none, Fa=none, Fs=[[1.0]])
    gains = Gains(np.array([[0.0], [5.0], [8.0]]), np.zeros((3, 1)))
    poles = [pole[0] for pole in certify(system, gains).poles]
    np.testing.assert_allclose(poles, [-1.0, -2.0, -4.0], atol=1e-12)


def test_minimum_norm_with_positive_p1_can_give_an_unstable_observer() -> None:
    """Nothing keeps P1 away from singularity, and the solver reports "optimal"."""
    v, gamma = unknowns(), 1.05 * gamma_lower_bound(MOTOR)
    squares = sum(cvxpy.sum_squares(m) for m in (v.P1, v.P2, v.P3, v.Y1, v.Y2))
    status, found = minimised(squares, v, gamma, v.P1 >> 0, solver="CLARABEL")
    assert status == "optimal"
    certificate = certify(MOTOR, found.gains(), gamma, found)
    assert certificate.poles[0][0] > 1e3
    assert certificate.reason.startswith("the pole")
    with pytest.raises(InputError, match="solver: CLARABEL said optimal, but the pole"):
        accepted("trap", MOTOR, found, gamma, "CLARABEL", status, 0.0)


def test_unachievable_gamma_from_a_solver_is_refuted() -> None:
    """SCS with tolerances of 1e-6 stops below the lower bound."""
    v, gamma = unknowns(), cvxpy.Variable()
    positive = v.P1 >> 0
    status, found = minimised(gamma, v, gamma, positive, solver="SCS", eps=1e-6, max_iters=20000)
    assert status == "optimal"
    value = float(gamma.value)
    assert value < gamma_lower_bound(MOTOR)
    with pytest.raises(InputError, match=r"said optimal, but gamma 1\.0.* is below 1\.00503781"):
        accepted("trap", MOTOR, found, value, "SCS", status, value)


def wrong(**changed: Any) -> str:
    gamma, found = good()
    arguments: dict[str, Any] = {"gains": found.gains(), "gamma": gamma, "variables": found}
    return certify(MOTOR, **{**arguments, **changed}).reason


def test_false_certificate_entries_are_refuted() -> None:
    found = good()[1]
    gains = found.gains()
    assert wrong() == ""
    assert wrong(gamma=1.0).startswith("gamma 1 is below 1.00503781, which no gains")
    assert "H-infinity norm" in wrong(gamma=1.02 * gamma_lower_bound(MOTOR), variables=None)
    assert "inequality is refuted" in wrong(gamma=1.02 * gamma_lower_bound(MOTOR))
    assert "inequality is refuted" in wrong(variables=replace(found, P2=found.P2 + 10.0))
    assert "P1 is not proved" in wrong(variables=replace(found, P1=found.P1 - 0.05 * np.eye(N)))
    assert "is not left of -5" in wrong(decay=5.0)
    assert "has real part -" in wrong(bound=10.0)
    singular = Gains(gains.L, -MOTOR.C_tilde.T)
    assert wrong(gains=singular, variables=None) == "Eo = I + Ld C~ has no inverse"
    assert "the pole 0" in wrong(gains=Gains(0 * gains.L, 0 * gains.L), variables=None)


def test_inequality_19_needs_a_gamma() -> None:
    with pytest.raises(InputError, match=r"gamma: must be given: \(19\) has one"):
        wrong(gamma=None)


def test_certificate_checks_the_given_gains_themselves() -> None:
    """Y is formed from the gains: a solution of (19) says nothing about other gains."""
    found = good()[1]
    gains = found.gains()
    assert wrong(gains=Gains(1.0001 * gains.L, gains.Ld)) == ""
    assert "inequality is refuted" in wrong(gains=Gains(0.3 * gains.L, gains.Ld))


def test_lower_bound_of_gamma_is_not_always_attained() -> None:
    """In this plant changing disturbances are harder than constants, so the bound is not
    attained."""
    system = random_plant(3, 6)
    assert pd_pi.design(system, 1.3).certificate.holds
    with pytest.raises(InputError):
        pd_pi.design(system, 1.2)


def test_pi_solution_proves_its_decay() -> None:
    """By P1 of the Lyapunov equation of Ao + 3 I, but not by P1 = I."""
    found = pi.design_feasible(MOTOR, 3.0)
    P1 = np.eye(N)
    reason = certify(MOTOR, found.gains, None, PiVariables(P1, found.gains.L.T @ P1)).reason
    assert reason == "the matrix inequality is refuted at the returned matrices"
    Ao, _ = error_system(MOTOR, found.gains)
    P1 = solve_continuous_lyapunov((Ao + 3 * np.eye(N)).T, -np.eye(N))
    proved = certify(MOTOR, found.gains, None, PiVariables(P1, found.gains.L.T @ P1), decay=3.0)
    assert proved.holds


@pytest.fixture
def half_a_decay() -> tuple[AugmentedSystem, Gains, PiVariables, float]:
    """Poles -1, -2, -4, and P1 with P1 Ao + Ao^T P1 + P1 = -I; its smallest eigenvalue."""
    none = np.zeros((1, 0))
    system = dc_motor(A=[[-1.0]], B=none, C=[[1.0]], Dd=[[1.0]], Dw=none, Fa=none, Fs=[[1.0]])
    gains = Gains(np.array([[0.0], [5.0], [8.0]]), np.zeros((3, 1)))
    shifted = error_system(system, gains)[0] + 0.5 * np.eye(3)
    P1 = solve_continuous_lyapunov(shifted.T, -np.eye(3))
    least = float(np.linalg.eigvalsh(P1)[0])
    return system, gains, PiVariables(P1, gains.L.T @ P1), least


def test_both_inequalities_must_be_proved(
    half_a_decay: tuple[AugmentedSystem, Gains, PiVariables, float],
) -> None:
    """The poles are right of -5, but this P1 proves only -(1 + 1 / least) / 2 = -5.46."""
    system, gains, variables, least = half_a_decay
    assert (1 + 1 / least) / 2 > 5.4
    refuted = certify(system, gains, None, variables, decay=0.5, bound=5.0)
    assert refuted.reason == "the matrix inequality is refuted at the returned matrices"


def test_pole_bound_not_shown_by_the_matrices_of_19_is_not_proved() -> None:
    """All poles are right of -15.8, which this P1 does not prove; it proves -31.4."""
    gamma, found = good()
    Ao, Eo = error_system(MOTOR, found.gains())
    fastest = -float(np.linalg.eigvals(np.linalg.solve(Eo, Ao)).real.min())
    certificates = [
        certify(MOTOR, found.gains(), gamma, found, bound=factor * fastest)
        for factor in (1.001, 2.0)
    ]
    assert [one.holds for one in certificates] == [False, True]
    assert certificates[0].reason == "the matrix inequality is refuted at the returned matrices"


def test_gamma_at_its_lower_bound_is_accepted() -> None:
    """The bound is approached by arbitrarily large designs, and computed with rounding."""
    floor = gamma_lower_bound(MOTOR)
    for gamma in (floor, np.nextafter(floor, 0.0)):
        assert "which no gains" not in wrong(gamma=float(gamma))
    assert "which no gains" in wrong(gamma=floor * (1 - 1e-10))
