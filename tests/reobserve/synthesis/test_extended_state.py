"""The inequality against its lemma, the lower bound, and designs by two solvers."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

import cvxpy
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import minimize

from reobserve.synthesis.extended_state import pd_pi, pi
from reobserve.synthesis.extended_state.certificate import error_system
from reobserve.synthesis.extended_state.design import CertifiedGains
from reobserve.synthesis.extended_state.gamma_bound import gamma_lower_bound
from reobserve.synthesis.extended_state.inequality import PdPiVariables, PiVariables
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from tests.reobserve.synthesis.plants import dc_motor, random_plant

Array = NDArray[np.float64]

FLOOR = 1.00503781018428  # of the paper's example


@cache
def minimum_norm() -> CertifiedGains:
    return pd_pi.design(dc_motor())


def drawn(seed: int) -> tuple[AugmentedSystem, PdPiVariables, Gains]:
    """Random P and gains, and the corresponding Y."""
    system = random_plant(seed, 3, 3, Az=np.diag([1.0, 2.0, 3.0]))
    rng, N = np.random.default_rng(seed), system.size
    root, P2, P3 = rng.normal(size=(3, N, N))
    gains = Gains(*rng.normal(size=(2, N, 3)))
    Y = np.hstack([gains.L.T, gains.Ld.T]) @ np.block([[root @ root.T, np.zeros((N, N))], [P2, P3]])
    return system, PdPiVariables(root @ root.T, P2, P3, Y[:, :N], Y[:, N:]), gains


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("decay", [0.0, 0.7])
def test_inequality_19_is_the_bounded_real_lemma_of_the_dual_descriptor_system(
    seed: int, decay: float
) -> None:
    system, v, gains = drawn(seed)
    N, gamma = system.size, 1.7
    Ao, Eo = error_system(system, gains)
    zero, one = np.zeros((N, N)), np.eye(N)
    E = np.block([[one, zero], [zero, zero]])
    A = np.block([[zero, one], [Ao.T, -Eo.T]]) + decay * E
    B = np.vstack([zero, one])
    C = np.hstack([system.Bo.T, np.zeros(system.Bo.T.shape)])
    P = np.block([[v.P1, zero], [v.P2, v.P3]])
    np.testing.assert_array_equal(E @ P, (E @ P).T)
    inputs, outputs = B.shape[1], len(C)
    lemma = np.block(
        [
            [A @ P + P.T @ A.T, B, P.T @ C.T],
            [B.T, -gamma * np.eye(inputs), np.zeros((inputs, outputs))],
            [C @ P, np.zeros((outputs, inputs)), -gamma * np.eye(outputs)],
        ]
    )
    scale = np.abs(lemma).max()
    np.testing.assert_allclose(np.block(v.blocks(system, gamma, decay)), lemma, atol=1e-12 * scale)


@pytest.mark.parametrize("seed", range(5))
def test_pole_bound_is_the_lemma_of_the_mirrored_pencil(seed: int) -> None:
    system, v, gains = drawn(seed)
    N, beta = system.size, 9.0
    Ao, Eo = error_system(system, gains)
    zero, one = np.zeros((N, N)), np.eye(N)
    E = np.block([[one, zero], [zero, zero]])
    A = -np.block([[zero, one], [Ao.T, -Eo.T]]) - beta * E
    P = np.block([[v.P1, zero], [v.P2, -v.P3]])
    lemma = A @ P + P.T @ A.T
    np.testing.assert_allclose(
        np.block(v.bound_blocks(system, beta)), lemma, atol=1e-12 * np.abs(lemma).max()
    )


@pytest.mark.parametrize("seed", range(5))
def test_recovered_gains_satisfy_their_definition(seed: int) -> None:
    system, v, gains = drawn(seed)
    N = system.size
    found = v.gains()
    P = np.block([[v.P1, np.zeros((N, N))], [v.P2, v.P3]])
    Y = np.hstack([v.Y1, v.Y2])
    np.testing.assert_allclose(
        np.hstack([found.L.T, found.Ld.T]) @ P, Y, atol=1e-12 * np.abs(Y).max()
    )
    np.testing.assert_allclose(found.L, gains.L, atol=1e-8 * np.linalg.cond(P))
    again = v.with_gains(found)
    np.testing.assert_allclose(again.Y1, v.Y1, atol=1e-12 * np.abs(Y).max())


@pytest.mark.parametrize("seed", range(3))
def test_pi_observer_lemma_is_equivalent_to_inequality_19(seed: int) -> None:
    """With P2 = Ao^T P1 and P3 = I / gamma it is the Schur complement of the last three blocks."""
    system, drawn_variables, gains = drawn(seed)
    N, gamma, decay, P1 = system.size, 1.7, 0.3, drawn_variables.P1
    Ao = system.A_tilde - gains.L @ system.C_tilde
    Y = gains.L.T @ P1
    ((short,),) = PiVariables(P1, Y).inequalities(system, gamma, decay)[0]
    full = PdPiVariables(P1, Ao.T @ P1, np.eye(N) / gamma, Y, np.zeros(Y.shape))
    left = np.block(full.blocks(system, gamma, decay))
    assert np.linalg.eigvalsh(left[N:, N:])[-1] < 0
    complement = left[:N, :N] - left[:N, N:] @ np.linalg.solve(left[N:, N:], left[N:, :N])
    np.testing.assert_allclose(short, gamma * complement, atol=1e-12 * np.abs(short).max())


def test_lower_bound_of_the_example_agrees_with_hand_calculation() -> None:
    """Errors under constant d1, d2, w: .1 d1 in speed, .001 d1 - d2 in fa, -.1 d1 - w in fs."""
    errors = [[0.1, 0, 0], [0.001, -1, 0], [-0.1, 0, -1]]
    assert gamma_lower_bound(dc_motor()) == pytest.approx(np.linalg.norm(errors, 2), rel=1e-14)
    assert gamma_lower_bound(dc_motor()) == pytest.approx(FLOOR, rel=1e-14)
    assert gamma_lower_bound(dc_motor(Az=50.0)) == pytest.approx(FLOOR, rel=1e-13)


FLOORS = {
    "as many outputs as faults": random_plant(0, 4, 2),
    "one more": random_plant(0, 4, 3),
    "one more, and four disturbances": random_plant(
        0, 4, 3, Dd=np.random.default_rng(3).normal(size=(4, 3))
    ),
}


@pytest.mark.parametrize("case", FLOORS)
def test_lower_bound_at_zero_frequency_is_respected_and_nearly_attained(case: str) -> None:
    system = FLOORS[case]
    floor = gamma_lower_bound(system)

    def gain(entries: Array) -> float:
        Ao = system.A_tilde - entries.reshape(system.size, -1) @ system.C_tilde
        return float(np.linalg.norm(np.linalg.solve(Ao, system.Bo), 2))

    rng = np.random.default_rng(1)
    found = []
    for _ in range(2):
        start = 10 * rng.normal(size=system.size * system.outputs)
        found.append(minimize(gain, start, options={"maxiter": 400}).fun)
    assert floor * (1 - 1e-12) <= min(found) <= floor * (1 + 1e-3)


def test_enough_outputs_give_a_zero_lower_bound() -> None:
    assert gamma_lower_bound(random_plant(0, 4, 4)) == 0
    found = pd_pi.design(random_plant(0, 4, 4), gamma=5.0).certificate
    assert found.holds
    assert found.floor == 0


def test_minimum_norm_design_of_the_example_is_certified() -> None:
    found = minimum_norm()
    assert found.gamma == pytest.approx(1.05 * FLOOR, rel=1e-13)
    assert found.objective == pytest.approx(692.83976821021, rel=1e-13)
    assert found.lower == pytest.approx(found.objective * (1 - 1e-5), abs=1e-9)
    assert found.certificate.norm_upper == pytest.approx(1.0546818, rel=3e-7)
    poles = [complex(*pole) for pole in found.certificate.poles]
    known = [-3.6352, -4.0597 - 3.0923j, -4.0597 + 3.0923j, -9.9023, -21.816, -34.149]
    np.testing.assert_allclose(poles, known, rtol=3e-4)
    assert np.abs(found.gains.Ld).max() == pytest.approx(2.7629, rel=5e-4)


@pytest.mark.parametrize("decay", [0.0, 0.5, 2.0])
def test_feasible_pi_observer_decays_as_specified(decay: float) -> None:
    found = pi.design_feasible(dc_motor(), decay).certificate
    assert found.poles[0][0] < -decay
    assert found.norm_lower > 1.2 * FLOOR


@pytest.mark.parametrize("solution", pi.SOLUTIONS)
@pytest.mark.parametrize("decay", [0.0, 3.0])
def test_every_feasible_pi_observer_decays_as_specified(solution: str, decay: float) -> None:
    found = pi.design_feasible(dc_motor(Az=10.0), decay, solution=solution)
    assert found.certificate.holds
    assert found.certificate.poles[0][0] < -decay


def inside(decay: float) -> tuple[Any, Any, Any, Any]:
    """For a solver: P, Y, the positive expressions, and the norm of both."""
    system = dc_motor()
    P, Y = cvxpy.Variable((6, 6), symmetric=True), cvxpy.Variable((2, 6))
    half = P @ (system.A_tilde + decay * np.eye(6)) - Y.T @ system.C_tilde
    both = cvxpy.hstack([cvxpy.vec(P, order="F"), cvxpy.vec(Y, order="F")])
    return P, Y, -half - half.T, cvxpy.norm(both)


def test_largest_margin_agrees_with_a_solver() -> None:
    P, _, left, size = inside(1.0)
    t, one = cvxpy.Variable(), np.eye(6)
    bounds = [P >> t * one, P << one, left >> t * one, size <= 100]
    best = cvxpy.Problem(cvxpy.Maximize(t), bounds).solve(solver="CLARABEL")
    found = pi.design_feasible(dc_motor(), 1.0, solution="largest_margin")
    assert best - 1e-3 < -found.objective < best


def test_analytic_centre_agrees_with_a_solver() -> None:
    P, Y, left, size = inside(1.0)
    whole = [cvxpy.log_det(each) for each in (P, left, np.eye(6) - P)]
    ball = cvxpy.log(100**2 - cvxpy.square(size))
    cvxpy.Problem(cvxpy.Maximize(sum(whole) + ball)).solve(solver="CLARABEL")
    found = pi.design_feasible(dc_motor(), 1.0, solution="positive").gains.L
    expected = np.linalg.solve(P.value, Y.value.T)
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(found).max())


def test_pi_observer_by_the_same_criterion_gives_the_same_estimates() -> None:
    """A remark of the paper: errors of both faults after a jump of either, over two seconds."""
    system = dc_motor()
    responses = []
    for found in (minimum_norm(), pi.design(system)):
        Ao, Eo = error_system(system, found.gains)
        poles, modes = np.linalg.eig(np.linalg.solve(Eo, Ao))
        weights = np.linalg.solve(modes, np.linalg.solve(Eo, system.Bo[:, -2:]))
        time = np.linspace(0, 2, 201)
        response = np.einsum("ik,tk,kj->tij", modes[-2:], np.exp(np.outer(time, poles)), weights)
        responses.append(response.real)
    assert np.abs(responses[1]).max() == pytest.approx(1.0, abs=0.05)
    difference = np.sqrt(np.mean((responses[0] - responses[1]) ** 2))
    assert difference < 0.01


def test_minimum_gamma_approaches_its_lower_bound_with_large_gains() -> None:
    """The larger the matrices may be, the closer: gamma has no attained minimum."""
    found = [pd_pi.design_minimum_gamma(dc_motor(), radius=radius) for radius in (300, 1000, 3000)]
    gammas = [design.gamma for design in found]
    assert np.all(np.diff(gammas) < -5e-4)
    assert FLOOR < found[-1].certificate.norm_upper < found[-1].gamma < FLOOR + 5e-4
    assert found[-1].objective == found[-1].gamma
    largest = [np.abs(design.gains.L).max() for design in found]
    assert np.all(np.diff(largest) > 1e3)
    assert largest[-1] > 1e4


def test_gains_grow_without_limit_near_the_lower_bound() -> None:
    factors = (1.1, 1.05, 1.02)
    largest = [np.abs(pd_pi.design(dc_motor(), factor).gains.L).max() for factor in factors]
    assert largest[1] / largest[0] == pytest.approx(1.72, abs=0.01)
    assert largest[2] / largest[1] == pytest.approx(1.95, abs=0.01)


@pytest.mark.parametrize(
    ("decay", "bound", "gamma"),
    [(0.0, 30.0, 1.00555771877), (0.0, 50.0, 1.00534017676), (2.0, 50.0, 1.24197110362)],
)
def test_poles_lie_in_the_specified_strip(decay: float, bound: float, gamma: float) -> None:
    found = pd_pi.design_minimum_gamma(dc_motor(), decay, bound)
    assert found.gamma == pytest.approx(gamma, abs=1e-10)
    assert found.lower == pytest.approx(gamma - 1e-6, abs=1e-10)
    assert found.radius == 3000
    real = [pole[0] for pole in found.certificate.poles]
    assert -bound < min(real) <= max(real) < -decay


def test_design_round_trips_through_json() -> None:
    found = minimum_norm()
    values = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert (values["lower"], values["radius"]) == (found.lower, None)
    again = CertifiedGains.from_dict(values)
    assert again.to_dict() == found.to_dict()
    assert again.certificate == found.certificate
    np.testing.assert_array_equal(again.gains.Ld, found.gains.Ld)
