"""The extended state observer: exact against an adaptive integration, and its theory."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are

from reobserve.core.discretisation import zero_order_hold
from reobserve.core.errors import InputError
from reobserve.observers.extended_state import EsoState, ExtendedStateObserver
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from tests.reobserve.synthesis.plants import dc_motor, random_plant

Array = NDArray[np.float64]

SYSTEM = dc_motor()
# Both place the poles near -34, -20, -11, -6, -4 and -3.5; rounded.
PI = Gains(
    np.array([[12.8, 25.2], [61.3, 243.0], [26.7, 5.7], [6.4, 37.8], [91.6, 332.8], [99.0, 16.8]]),
    np.zeros((6, 2)),
)
PD_PI = Gains(
    np.array(
        [[26.3, 50.2], [90.8, 504.1], [63.0, 10.0], [9.2, 79.3], [137.5, 693.1], [231.7, 25.4]]
    ),
    np.array([[0.2, 0.0], [0.0, 0.4], [1.5, 0.0], [0.0, 1.0], [0.0, 1.5], [1.2, 0.0]]),
)
GAINS = {"PI": PI, "PD/PI": PD_PI}
SENSOR_ROWS = np.array([1.0, 1.0, 1.0, 1.0, 1.0, -1.0])[:, None]


# What is known of y and u between samples: nothing, left limits, or midpoints as well.
KNOWN = {"samples": 0, "limits": 1, "middles": 2}


def record(known: str, rows: int = 60, seed: int = 5) -> dict[str, Any]:
    """Random y and u that jump at the samples, with the known limits."""
    rng = np.random.default_rng(seed)
    pairs = [(rng.normal(size=(rows, 2)), rng.normal(size=(rows, 1))) for _ in range(3)]
    extra = dict(zip(("before", "middle")[: KNOWN[known]], pairs[1:], strict=False))
    return {"y": pairs[0][0], "u": pairs[0][1], **extra}


def part(whole: dict[str, Any], rows: Any) -> dict[str, Any]:
    return {
        name: tuple(each[rows] for each in value) if isinstance(value, tuple) else value[rows]
        for name, value in whole.items()
    }


def stacked(run: Any) -> Array:
    return np.concatenate([run["state"], run["actuator_fault"], run["sensor_fault"]], axis=-1)


# --- Against an adaptive integration ------------------------------------------------------------


@pytest.mark.parametrize("gains", GAINS.values(), ids=GAINS)
@pytest.mark.parametrize("known", KNOWN)
def test_sampling_is_exact_for_known_intersample_behaviour(known: str, gains: Gains) -> None:
    # The form without x^' and Y' on either side: zeta = (I + Ld C~) x^ - Ld Y.
    system, period, samples = SYSTEM, 0.25, record(known, rows=12)
    C, Eo = system.C_tilde, np.eye(6) + gains.Ld @ system.C_tilde
    start, filtered = np.linspace(-1, 1, 6), np.array([0.3, -0.2])
    observer = ExtendedStateObserver(system, gains=gains, sampling_period=period)
    run = observer.run(**samples, start=observer.init(start, filtered=filtered))
    z = np.concatenate([filtered, Eo @ start - gains.Ld @ filtered])
    for k in range(12):
        x = np.linalg.solve(Eo, z[2:] + gains.Ld @ z[:2])
        assert stacked(run)[k] == pytest.approx(x[[0, 1, 4, 5]], rel=1e-10, abs=1e-10)
        if k == 11:
            break
        # At the start, the middle and the end of the step: y and u.
        y0, u0, y1 = samples["y"][k], samples["u"][k], samples["y"][k + 1]
        ends = [np.hstack([y0, u0]), np.hstack([y1, u0])]
        if known != "samples":
            ends[1] = np.hstack([each[k + 1] for each in samples["before"]])
        ends.append(0.5 * (ends[0] + ends[1]))
        if known == "middles":
            ends[2] = np.hstack([each[k + 1] for each in samples["middle"]])
        coefficients = np.polynomial.polynomial.polyfit([0.0, 1.0, 0.5], ends, 2)

        def rate(t: float, z: Array, coefficients: Array = coefficients) -> Array:
            powers = (t / period) ** np.arange(len(coefficients))
            y, u = np.split(powers @ coefficients, [2])
            x = np.linalg.solve(Eo, z[2:] + gains.Ld @ z[:2])
            moved = (system.A_tilde - gains.L @ C) @ x + gains.L @ z[:2]
            return np.concatenate([system.Az @ (y - z[:2]), moved + 2 * u[0] * np.eye(6)[1]])

        z = solve_ivp(rate, (0, period), z, method="DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


# --- Theory -------------------------------------------------------------------------------------


@pytest.mark.parametrize("gains", GAINS.values(), ids=GAINS)
def test_constant_faults_are_estimated_exactly(gains: Gains) -> None:
    # At rest with u = 1: x from 0 = A x + B (u + fa).
    fault, sensor = 0.3, -0.2
    x = np.linalg.solve(-SYSTEM.A, [0.0, 2 * (1.0 + fault)])
    y, u = np.tile(x + np.array([sensor, 0.0]), (1000, 1)), np.ones((1000, 1))
    run = ExtendedStateObserver(SYSTEM, gains=gains, sampling_period=0.02).run(y, u)
    assert stacked(run)[-1] == pytest.approx([*x, fault, sensor], abs=1e-12)


def test_printed_sign_inverts_the_sensor_fault() -> None:
    # -Az Fs in the lower block of F, with its gains: rows of fs with the other sign.
    printed = AugmentedSystem(**{**_matrices(), "Fs": -SYSTEM.Fs})
    assert np.array_equal(printed.F[2:, 1], -SYSTEM.F[2:, 1])
    turned = Gains(SENSOR_ROWS * PD_PI.L, SENSOR_ROWS * PD_PI.Ld)
    run, other = (
        observer.run(**record("samples"), start=observer.init())
        for observer in (
            ExtendedStateObserver(SYSTEM, gains=PD_PI, sampling_period=0.01),
            ExtendedStateObserver(printed, gains=turned, sampling_period=0.01),
        )
    )
    assert other["sensor_fault"] == pytest.approx(-run["sensor_fault"], rel=1e-11, abs=1e-12)
    assert other["actuator_fault"] == pytest.approx(run["actuator_fault"], rel=1e-11, abs=1e-12)
    with pytest.raises(InputError, match=r"^L: and Ld give no stable observer"):
        ExtendedStateObserver(printed, gains=PD_PI, sampling_period=0.01)


def _matrices() -> dict[str, Array]:
    return {name: getattr(SYSTEM, name) for name in ("A", "B", "C", "Dd", "Dw", "Fa", "Fs")}


def test_many_states_use_the_same_arithmetic() -> None:
    system = random_plant(4, states=14)
    weight = np.eye(system.size)
    P = solve_continuous_are(system.A_tilde.T, system.C_tilde.T, weight, 0.1 * np.eye(2))
    gains = Gains(10 * P @ system.C_tilde.T, np.zeros((system.size, 2)))
    observer = ExtendedStateObserver(system, gains=gains, sampling_period=0.05)
    samples = record("samples", rows=40)
    y, u = samples["y"], samples["u"]
    # Held, by left limits, as in scipy's sampling.
    before = tuple(np.vstack([each[:1], each[:-1]]) for each in (y, u))
    run = observer.run(y, u, before=(before[0], before[1]))
    upper = np.hstack([-system.Az, np.zeros((2, system.size))])
    lower = np.hstack([gains.L, system.A_tilde - gains.L @ system.C_tilde])
    inputs = np.zeros((2 + system.size, 3))
    inputs[:2, :2], inputs[2 : 4 + 14, 2:] = system.Az, system.Ba
    transition, effect = zero_order_hold(np.vstack([upper, lower]), inputs, 0.05)
    z = np.zeros(2 + system.size)
    for k in range(39):
        z = transition @ z + effect @ [*y[k], *u[k]]
    assert run["state"][-1] == pytest.approx(z[2:16], rel=1e-11)
    assert stacked(run)[-1, 14:] == pytest.approx(z[18:], rel=1e-11)


def test_filter_scales_with_its_rates() -> None:
    # Az with unequal rates, known x, no error: the estimates stay exact.
    system = dc_motor(Az=[[3.0, 1.0], [0.0, 0.5]])
    weight, noise = np.eye(6), np.eye(2)
    P = solve_continuous_are(system.A_tilde.T, system.C_tilde.T, weight, noise)
    gains = Gains(P @ system.C_tilde.T, PD_PI.Ld)
    observer = ExtendedStateObserver(system, gains=gains, sampling_period=0.1)
    x = np.linalg.solve(-SYSTEM.A, [0.0, 2 * 1.3])
    y = x + np.array([0.4, 0.0])
    start = observer.init([*x, *y, 0.3, 0.4], filtered=y)
    run = observer.run(np.tile(y, (50, 1)), np.ones((50, 1)), start=start)
    assert np.abs(stacked(run) - [*x, 0.3, 0.4]).max() < 1e-12


# --- One sample at a time -----------------------------------------------------------------------


def test_estimate_does_not_depend_on_later_samples() -> None:
    observer = ExtendedStateObserver(SYSTEM, gains=PI, sampling_period=0.01)
    # y of a row enters the estimate of that row, u that of the next one.
    for name, first in (("y", 5), ("u", 6)):
        one, other = record("samples", rows=9), record("samples", rows=9)
        other[name][5] += 1.0
        runs = [stacked(observer.run(**each)) for each in (one, other)]
        differs = np.flatnonzero((runs[0] != runs[1]).any(axis=1))
        assert differs[0] == first


def test_midpoints_of_linear_and_held_inputs_change_nothing() -> None:
    samples = record("samples")
    y, u = samples["y"], samples["u"]
    observer = ExtendedStateObserver(SYSTEM, gains=PD_PI, sampling_period=0.02)
    last = np.vstack([y[:1], y[:-1]]), np.vstack([u[:1], u[:-1]])
    reported = observer.run(y, u, before=(y, last[1]), middle=(0.5 * (y + last[0]), last[1]))
    assert stacked(reported) == pytest.approx(stacked(observer.run(y, u)), rel=1e-11, abs=1e-12)


# --- Bad input ----------------------------------------------------------------------------------


def test_unstable_gains_are_refused_with_their_eigenvalues() -> None:
    with pytest.raises(InputError) as caught:
        ExtendedStateObserver(
            SYSTEM, gains=Gains(np.zeros((6, 2)), np.zeros((6, 2))), sampling_period=0.01
        )
    # A~ alone: two uncontrolled faults, the filter and the motor.
    assert caught.value.parameter == "L"
    assert caught.value.problem.endswith("they are 0, 0, -1, -1, -2.0025, -9.9975")


def test_poles_equal_the_error_eigenvalues() -> None:
    expected = [-3.4974, -3.9891, -6.0148, -10.9973, -20.0468, -33.9546]
    found = ExtendedStateObserver(SYSTEM, gains=PI, sampling_period=0.01).poles
    assert found == pytest.approx(np.array(expected), abs=5e-5)


def test_singular_mass_matrix_is_refused() -> None:
    Ld = PD_PI.Ld.copy()
    Ld[2:4] = -np.eye(2)
    with pytest.raises(InputError, match=r"^Ld: makes Eo = I \+ Ld C~ singular: .* down to 0"):
        ExtendedStateObserver(SYSTEM, gains=Gains(PD_PI.L, Ld), sampling_period=0.01)


@pytest.mark.parametrize(
    ("changed", "problem"),
    [
        ({"sampling_period": 0.0}, "sampling_period: 0 must be greater than zero"),
        ({"gains": Gains(PI.L[:5], PI.Ld)}, r"L: has shape \(5, 2\), must be \(6, 2\)"),
        ({"gains": Gains(PI.L, PI.Ld.T)}, r"Ld: has shape \(2, 6\), must be \(6, 2\)"),
        ({"gains": Gains(PI.L * np.nan, PI.Ld)}, "L: .* not finite"),
    ],
)
def test_invalid_observers_are_refused(changed: dict[str, Any], problem: str) -> None:
    good: dict[str, Any] = {"system": SYSTEM, "gains": PI, "sampling_period": 0.01}
    with pytest.raises(InputError, match=f"^{problem}"):
        ExtendedStateObserver(**{**good, **changed})


Y, U = np.zeros((4, 2)), np.zeros((4, 1))


def test_state_of_another_observer_is_refused() -> None:
    state = EsoState(np.zeros(2), np.zeros(5))
    with pytest.raises(InputError, match=r"^start: must be of an observer of size 6"):
        ExtendedStateObserver(SYSTEM, gains=PI, sampling_period=0.01).run(
            np.zeros((4, 2)), np.zeros((4, 1)), start=state
        )


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        ({"estimate": [1.0]}, r"estimate: has shape \(1,\), must be a list of 6 numbers"),
        ({"filtered": [1.0, np.inf]}, "filtered: .* not finite"),
    ],
)
def test_invalid_states_are_refused(arguments: dict[str, Any], problem: str) -> None:
    with pytest.raises(InputError, match=f"^{problem}"):
        ExtendedStateObserver(SYSTEM, gains=PI, sampling_period=0.01).init(**arguments)
