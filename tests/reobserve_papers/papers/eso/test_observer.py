"""The observer of the controlled motor: against an adaptive integration of (8), and its theory."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov

from reobserve.core.discretisation import zero_order_hold
from reobserve.observers.extended_state import EsoState, ExtendedStateObserver
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.run import Run
from reobserve.synthesis.extended_state.system import Gains
from reobserve_papers.plants.dc_motor import ControlledMotor, MotorRun, SpeedControl
from tests.reobserve.observers.test_extended_state import GAINS, PD_PI, PI, SYSTEM, stacked
from tests.reobserve_papers.plants.test_dc_motor import (
    HOLD,
    LOOP,
    MATRICES,
    MOTOR,
    NOTHING,
    constant,
    held_inputs,
    integrated,
    loop_rates,
    measured,
    simulated,
)

Array = NDArray[np.float64]


def observed(run: MotorRun, gains: Gains, step: float, known: str = "middles") -> Run[EsoState]:
    """Estimates from a simulated motor: at each step, or each second one with midpoints."""
    after, before = run.after, run.before
    if known == "middles":
        observer = ExtendedStateObserver(SYSTEM, gains=gains, sampling_period=2 * step)
        return run_on_halves(
            observer, after.output, after.control, start=observer.init(),
            y_before=before.output, u_before=before.control,
        )  # fmt: skip
    observer = ExtendedStateObserver(SYSTEM, gains=gains, sampling_period=step)
    limits = None if known == "samples" else (before.output, before.control)
    return observer.run(after.output, after.control, start=observer.init(), before=limits)


# --- Against an adaptive integration ------------------------------------------------------------


def both_rates(z: Array, d: Array, w: Array, fa: Array, fs: Array, r: Array) -> list[Array]:
    """Plant and control, the filter, and (8) as printed for both gains, with Y'."""
    y, u = measured(z[:2], z[2:3], w, fs)
    slope = y - z[3:5]
    rates = [*loop_rates(z[:3], d, w, fa, fs, r), slope]
    for gains, x in ((PI, z[5:11]), (PD_PI, z[11:])):
        known = np.concatenate([MOTOR.A @ x[:2] + 2.0 * np.array([0, u[0] + x[4]]), np.zeros(4)])
        known[2:4] = x[:2] - x[2:4] + np.array([x[5], 0.0])
        # x^' = known + L (Y - Y^) + Ld (Y' - Y^'), and Y^' is a part of x^'.
        right = known + gains.L @ (z[3:5] - x[2:4]) + gains.Ld @ slope
        rates.append(np.linalg.solve(np.eye(6) + gains.Ld @ np.eye(2, 6, 2), right))
    return rates


@pytest.fixture(scope="module", params=[1.0, 0.0], ids=["disturbed", "undisturbed"])
def truth(request: pytest.FixtureRequest) -> tuple[tuple[Array, Array], Array]:
    d, w = held_inputs()
    inputs = d * request.param, w * request.param
    return inputs, integrated(both_rates, 17, inputs)


@pytest.mark.parametrize("name", GAINS)
def test_estimates_agree_with_integration_over_jumping_faults(
    truth: tuple[tuple[Array, Array], Array], name: str
) -> None:
    inputs, expected = truth
    step = 5e-4
    run = observed(simulated(LOOP, step, inputs), GAINS[name], step)
    places = np.array([0, 1, 4, 5]) + (5 if name == "PI" else 11)
    assert np.abs(stacked(run)[:: round(HOLD / step / 2)] - expected[:, places]).max() < 1e-10


@pytest.mark.parametrize(("known", "order"), [("limits", 2), ("middles", 4)])
def test_error_falls_with_the_period_as_stated(
    truth: tuple[tuple[Array, Array], Array], known: str, order: int
) -> None:
    inputs, expected = truth
    errors = []
    for step in (5e-3, 2.5e-3):
        run = observed(simulated(LOOP, step, inputs), PD_PI, step, known)
        rows = stacked(run)[:: round(HOLD / step / (2 if known == "middles" else 1))]
        errors.append(np.abs(rows - expected[:, [11, 12, 15, 16]]).max())
    assert abs(np.log2(errors[0] / errors[1]) - order) < 0.15


# --- Theory -------------------------------------------------------------------------------------


@pytest.mark.parametrize("gains", GAINS.values(), ids=GAINS)
def test_fault_estimates_depend_on_neither_control_nor_reference(gains: Gains) -> None:
    # e' = Eo^-1 (Ao e + Bo dD): u acts on plant and observer, and cancels.
    other = ControlledMotor(MOTOR, SpeedControl.placed(MOTOR, (-2, -5, -9)), **MATRICES)
    step = 5e-4
    runs = [simulated(LOOP, step), simulated(other, step, reference=constant(-3.0))]
    found = [observed(run, gains, step) for run in runs]
    assert np.abs(runs[0].state - runs[1].state).max() > 3
    for name in ("actuator_fault", "sensor_fault"):
        assert np.abs(found[0][name] - found[1][name]).max() < 1e-9
    errors = [each["state"] - run.state[::2] for each, run in zip(found, runs, strict=True)]
    assert np.abs(errors[0] - errors[1]).max() < 1e-9


@pytest.fixture(scope="module")
def long_run() -> MotorRun:
    """2000 s without faults, at steps of 5 ms."""
    return simulated(LOOP, 5e-3, held_inputs(11, 2000.0), NOTHING, NOTHING, NOTHING)


@pytest.mark.parametrize("gains", GAINS.values(), ids=GAINS)
def test_deviations_agree_with_a_lyapunov_equation(gains: Gains, long_run: MotorRun) -> None:
    # At the instants where the held d and w change, e(k+1) = transition e(k) + effect [d, w].
    mass = np.eye(6) + gains.Ld @ SYSTEM.C_tilde
    Ao, Bo = np.linalg.solve(mass, SYSTEM.A_tilde - gains.L @ SYSTEM.C_tilde), SYSTEM.Bo[:, :3]
    transition, effect = zero_order_hold(Ao, np.linalg.solve(mass, Bo), HOLD)
    driven = effect @ np.diag([0.4**2 / 12, 0.2**2 / 12, 1e-3]) @ effect.T
    covariance = solve_discrete_lyapunov(transition, driven)

    error = stacked(observed(long_run, gains, 5e-3))
    error[:, :2] -= long_run.state[::2]
    settled = error[::10][100:]
    for place, column in enumerate([0, 1, 4, 5]):
        variance, lagged = covariance[column, column], covariance
        correlations = []
        for _ in range(100):
            correlations.append(lagged[column, column] / variance)
            lagged = transition @ lagged
        spread = 2 * np.sum(np.square(correlations)) - 1
        standard_error = np.sqrt(2 * spread / len(settled))
        assert standard_error < 0.04
        assert abs(np.mean(settled[:, place] ** 2) / variance - 1) < 4 * standard_error
