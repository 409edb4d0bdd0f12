"""The DC motor and its control: exact sampling, the stated step response, jumps, and bad input."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reobserve.core.errors import DivergenceError, InputError
from reobserve_papers.plants.dc_motor import (
    ControlledMotor,
    DCMotor,
    MotorRun,
    SpeedControl,
)
from reobserve_papers.signals.inputs import Signal, Term
from reobserve_papers.signals.signal_shapes import Constant

Array = NDArray[np.float64]

CONSTANTS: dict[str, Any] = {
    "inertia": 0.01,
    "friction": 0.1,
    "torque_constant": 0.01,
    "emf_constant": 0.01,
    "resistance": 1.0,
    "inductance": 0.5,
}
MOTOR = DCMotor(**CONSTANTS)
POLES = (-3 + 2.25j, -3 - 2.25j, -12)
MATRICES: dict[str, Any] = {"Dd": np.diag([1.0, 2.0]), "Dw": [[1.0], [0.0]], "Fs": [[1.0], [0.0]]}
LOOP = ControlledMotor(MOTOR, SpeedControl.placed(MOTOR, POLES), **MATRICES)

HORIZON = 20.0
HOLD = 0.1  # s, the period of disturbance and noise


@dataclass(frozen=True)
class RampedSine:
    """slope * t * sin(frequency * t)."""

    slope: float
    frequency: float

    def __call__(self, time: Array, before: bool) -> Array:
        return self.slope * time * np.sin(self.frequency * time)

    def derivative(self) -> None:
        return None


SENSOR_FAULT = Signal(
    1,
    (
        Term(0, 1.5, 4.0, Constant(0.1)),
        Term(0, 4.0, 10.0, RampedSine(0.01, 0.5 * np.pi)),
        Term(0, 10.0, np.inf, Constant(0.2)),
    ),
)
ACTUATOR_FAULT = Signal(
    1,
    (
        Term(0, 1.5, 15.0, RampedSine(0.05, 0.25 * np.pi)),
        Term(0, 15.0, np.inf, Constant(0.2)),
    ),
)
PULSES = Signal.parse(
    "r", [{"kind": "square", "axis": 1, "until": 20, "high": 1, "period": 4}], axes=1
)
NOTHING = Signal(1, ())


def constant(value: float) -> Signal:
    return Signal(1, (Term(0, 0.0, np.inf, Constant(value)),))


def held_inputs(seed: int = 3, horizon: float = HORIZON) -> tuple[Array, Array]:
    """d and w of the paper's sizes, one row per period."""
    rng = np.random.default_rng(seed)
    rows = round(horizon / HOLD)
    return rng.uniform(-1, 1, (rows, 2)) * [0.2, 0.1], rng.normal(size=(rows, 1)) * np.sqrt(1e-3)


def simulated(
    loop: ControlledMotor,
    step: float,
    inputs: tuple[Array, Array] | None = None,
    reference: Signal = PULSES,
    sensor_fault: Signal = SENSOR_FAULT,
    actuator_fault: Signal = ACTUATOR_FAULT,
) -> MotorRun:
    d, w = held_inputs() if inputs is None else inputs
    repeats = round(HOLD / step)
    d, w = np.repeat(d, repeats, axis=0), np.repeat(w, repeats, axis=0)
    return loop.simulate(reference, actuator_fault, sensor_fault, d, w, step)


def integrated(rates: Callable[..., Any], size: int, inputs: tuple[Array, Array]) -> Array:
    """z of the linear z' = rates(z, d, w, fa, fs, r), at the ends of the periods of d and w.

    By an adaptive method that restarts at jumps; from zero.
    """

    def of(z: Any, each: Any) -> Array:
        return np.concatenate(rates(z, each[:2], each[2:3], each[3:4], each[4:5], each[5:]))

    state = np.transpose([of(row, np.zeros(6)) for row in np.eye(size)])
    known = np.transpose([of(np.zeros(size), row) for row in np.eye(6)])
    found = [np.zeros(size)]
    for k, (d, w) in enumerate(zip(*inputs, strict=True)):
        ends = (k * HOLD, (k + 1) * HOLD)
        acting = np.array([0.5 * (ends[0] + ends[1])])
        # An input active in the middle of a period is active up to both of its ends.
        shapes = [
            [term.shape for term in signal.terms if term.onset < acting[0] < term.end]
            for signal in (ACTUATOR_FAULT, SENSOR_FAULT)
        ]
        forced = known[:, :3] @ [*d, *w] + known[:, 5] * PULSES(acting)[0, 0]

        def rate(t: float, z: Array, shapes: Any = shapes, forced: Any = forced) -> Array:
            faults = [
                sum((shape(np.array([t]), False)[0] for shape in each), 0.0) for each in shapes
            ]
            return state @ z + forced + known[:, 3:5] @ faults

        whole = solve_ivp(rate, ends, found[-1], method="DOP853", rtol=1e-12, atol=1e-14)
        found.append(whole.y[:, -1])
    return np.array(found)


def loop_rates(z: Array, d: Array, w: Array, fa: Array, fs: Array, r: Array) -> list[Array]:
    """The rates of x and v, from the equations of the plant and its control."""
    x, v = z[:2], z[2:3]
    y, u = measured(x, v, w, fs)
    return [MOTOR.A @ x + MOTOR.B @ (u + fa) + [1.0, 2.0] * d, y[:1] - r]


def measured(x: Array, v: Array, w: Array, fs: Array) -> tuple[Array, Array]:
    y = x + np.array([1.0, 0.0]) * (w + fs)
    return y, -np.array([3.02125, 3.0]) @ y - 84.375 * v


# --- The motor and its gains --------------------------------------------------------------------


def test_back_emf_brakes_while_the_printed_sign_accelerates() -> None:
    # s^2 + 12 s + 20 +- 0.02
    for printed, sign in ((False, -1), (True, 1)):
        root = np.sqrt(16 + sign * 0.02)
        poles = np.sort(np.linalg.eigvals(DCMotor(**CONSTANTS, printed=printed).A))
        assert poles == pytest.approx([-6 - root, -6 + root], rel=1e-13)
    assert -6 - np.sqrt(15.98) == pytest.approx(-9.9975, abs=5e-5)
    assert -6 - np.sqrt(16.02) == pytest.approx(-10.0025, abs=5e-5)
    assert np.array_equal(MOTOR.A, [[-10.0, 1.0], [-0.02, -2.0]])
    assert np.array_equal(MOTOR.B, [[0.0], [2.0]])


def test_gains_agree_with_pole_placement() -> None:
    law = SpeedControl.placed(MOTOR, POLES)
    assert law.feedback == pytest.approx([3.02125, 3.0], rel=1e-13)
    # The integral is that of y - r: only a negative gain is stable.
    assert law.integral == pytest.approx(-84.375, rel=1e-13)


@pytest.mark.parametrize("poles", [(-5, -6, -7), (-1 + 9j, -1 - 9j, -0.2), (-4, -4, -4)])
def test_closed_loop_has_the_specified_poles(poles: tuple[complex, ...]) -> None:
    law = SpeedControl.placed(MOTOR, poles)
    loop = np.block([[MOTOR.A - MOTOR.B @ law.feedback[None], MOTOR.B * law.integral], [1, 0, 0]])
    assert np.poly(loop) == pytest.approx(np.poly(poles).real, rel=1e-12)


def step_response(poles: Any) -> tuple[float, float]:
    """Overshoot, and the time after which the speed stays within 2 %."""
    loop = ControlledMotor(MOTOR, SpeedControl.placed(MOTOR, poles), **MATRICES)
    nothing = (np.zeros((50, 2)), np.zeros((50, 1)))
    run = simulated(loop, 1e-3, nothing, constant(1.0), NOTHING, NOTHING)
    speed = run.state[:, 0]
    return speed.max() - 1.0, 1e-3 * (np.flatnonzero(np.abs(speed - 1.0) > 0.02)[-1] + 1)


def test_step_response_of_the_chosen_poles_meets_the_specification() -> None:
    overshoot, settling_time = step_response(POLES)
    assert overshoot == pytest.approx(0.0141, abs=5e-5)
    assert settling_time == pytest.approx(1.10, abs=5e-3)


# --- Simulation ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def truth() -> Array:
    return integrated(loop_rates, 3, held_inputs())


def test_agrees_with_an_adaptive_integration(truth: Array) -> None:
    run = simulated(LOOP, 5e-3)
    assert np.abs(run.state[::20] - truth[:, :2]).max() < 1e-10
    # At the ends of periods, from inside: d and w are those of the period.
    _, w = held_inputs()
    time = np.arange(1, len(truth)) * HOLD
    fs = SENSOR_FAULT(time, before=True)
    for k in range(len(w)):
        y, u = measured(truth[k + 1, :2], truth[k + 1, 2:], w[k], fs[k])
        assert run.before.output[20 * (k + 1)] == pytest.approx(y, abs=1e-10)
        assert run.before.control[20 * (k + 1)] == pytest.approx(u, abs=1e-8)


def test_state_feedback_agrees_with_an_adaptive_integration() -> None:
    """u = -Kc x + Ki v, with v still that of the measured speed."""
    Kc, Ki = np.array([3.02125, 3.0]), -84.375

    def rates(z: Array, d: Array, w: Array, fa: Array, fs: Array, r: Array) -> list[Array]:
        x, v = z[:2], z[2:3]
        y1 = x[:1] + w + fs
        return [MOTOR.A @ x + MOTOR.B @ (Ki * v - Kc @ x + fa) + [1.0, 2.0] * d, y1 - r]

    inputs = held_inputs(horizon=4.0)
    found = integrated(rates, 3, inputs)
    loop = ControlledMotor(MOTOR, LOOP.control, **MATRICES, state_feedback=True)
    run = simulated(loop, 5e-3, inputs)
    assert np.abs(run.state[::20] - found[:, :2]).max() < 1e-10
    control = Ki * found[:, 2] - found[:, :2] @ Kc
    assert run.after.control[::20, 0] == pytest.approx(control, abs=1e-8)
    assert np.abs(run.state - simulated(LOOP, 5e-3, inputs).state).max() > 0.01
    with pytest.raises(InputError, match=r"^state_feedback: "):
        ControlledMotor(MOTOR, LOOP.control, **MATRICES, state_feedback="yes")  # type: ignore[arg-type]


def test_error_is_of_fourth_order_in_the_step(truth: Array) -> None:
    errors = [
        np.abs(simulated(LOOP, step).state[:: round(HOLD / step)] - truth[:, :2]).max()
        for step in (0.05, 0.025)
    ]
    assert 3.7 < np.log2(errors[0] / errors[1]) < 4.3


def test_controller_mistakes_a_sensor_fault_for_speed() -> None:
    # In steady state y1 = r whatever the sensor fault, and the voltage compensates for fa.
    nothing = (np.zeros((100, 2)), np.zeros((100, 1)))
    run = simulated(LOOP, 0.01, nothing, constant(1.0), constant(0.1), constant(-0.3))
    assert run.state[-1] == pytest.approx([0.9, 9.0], rel=1e-12)
    assert run.after.control[-1] == pytest.approx([0.3 + 9.0 + 0.01 * 0.9], rel=1e-12)


def test_limits_differ_only_at_jumps() -> None:
    run = simulated(LOOP, 0.05)
    _, w = held_inputs()
    jump = run.after.output - run.before.output
    noise = np.zeros(len(jump))
    noise[2:-1:2] = np.diff(w[:, 0])
    faults = (run.after.sensor_fault - run.before.sensor_fault)[:, 0]
    assert jump[:, 0] == pytest.approx(noise + faults, abs=1e-13)
    assert not jump[:, 1].any()
    assert np.array_equal(np.flatnonzero(np.abs(faults) > 1e-6), [30, 80, 200])
    assert faults[[30, 80, 200]] == pytest.approx([0.1, -0.1, 0.2], abs=1e-13)
    control = run.after.control - run.before.control
    assert control[:, 0] == pytest.approx(-3.02125 * jump[:, 0], abs=1e-12)
    onset = run.after.actuator_fault[30] - run.before.actuator_fault[30]
    assert onset == pytest.approx(0.05 * 1.5 * np.sin(0.375 * np.pi), rel=1e-13)
    for name in ("output", "control", "actuator_fault", "sensor_fault"):
        assert np.array_equal(getattr(run.before, name)[0], getattr(run.after, name)[0])


def test_wrong_sign_of_the_integral_diverges() -> None:
    loop = ControlledMotor(MOTOR, SpeedControl([3.02125, 3.0], 84.375), **MATRICES)
    nothing = np.zeros((2000, 2)), np.zeros((2000, 1))
    with pytest.raises(
        DivergenceError, match="motor diverged: its state is finite up to t = "
    ) as e:
        loop.simulate(constant(2.0), NOTHING, NOTHING, *nothing, 1.0)
    begun = np.zeros((50, 2)), np.zeros((50, 1))
    early = loop.simulate(constant(2.0), NOTHING, NOTHING, *begun, 1.0).state
    sizes = np.log(np.abs(early[-2:]).max(axis=1))
    left = (np.log(np.finfo(float).max) - sizes[1]) / (sizes[1] - sizes[0])
    assert 0.35 < left % 1.0 < 0.95, "so that neither rounding nor the other states decide"
    assert e.value.time == 50 + np.floor(left)


# --- Bad input ----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CONSTANTS)
def test_constants_must_be_positive(name: str) -> None:
    with pytest.raises(InputError, match=f"^{name}: 0 must be greater than zero"):
        DCMotor(**{**CONSTANTS, name: 0.0})


@pytest.mark.parametrize("poles", [(-1, -2), (-1, -2, 0.5), (-1 + 1j, -1 + 2j, -3), (np.nan,) * 3])
def test_invalid_poles_are_refused(poles: Any) -> None:
    with pytest.raises(InputError, match=r"^poles: .* must be 3, stable, complex ones in pairs"):
        SpeedControl.placed(MOTOR, poles)


@pytest.mark.parametrize(
    ("changed", "problem"),
    [
        ({"disturbance": np.zeros((5, 1))}, r"disturbance: has shape \(5, 1\), must be \(5, 2\)"),
        ({"noise": np.zeros((4, 1))}, r"noise: has shape \(4, 1\), must be \(5, 1\): a row a step"),
        ({"disturbance": np.zeros((0, 2))}, r"disturbance: has shape \(0, 2\), must be \(1, 2\)"),
        ({"step": 0.0}, "step: 0 must be greater than zero"),
        (
            {"sensor_fault": Signal(2, ())},
            "sensor_fault: has 2 axes, must have 1 as Fs has columns",
        ),
        ({"initial_state": [1.0]}, r"initial_state: has shape \(1,\), must be a list of 2"),
    ],
)
def test_invalid_simulation_arguments_are_refused(changed: dict[str, Any], problem: str) -> None:
    good: dict[str, Any] = {
        "reference": PULSES,
        "actuator_fault": NOTHING,
        "sensor_fault": NOTHING,
        "disturbance": np.zeros((5, 2)),
        "noise": np.zeros((5, 1)),
        "step": 0.01,
    }
    with pytest.raises(InputError, match=f"^{problem}"):
        LOOP.simulate(**{**good, **changed})


def test_matrices_of_the_motor_have_two_rows() -> None:
    with pytest.raises(InputError, match=r"^Fs: has shape \(1, 2\), must have 2 rows"):
        ControlledMotor(MOTOR, LOOP.control, **{**MATRICES, "Fs": [[1.0, 0.0]]})


def test_left_limit_at_the_start_equals_the_right_limit() -> None:
    """There is no time before the first row: its left limit equals its right limit."""
    nothing = (np.zeros((40, 2)), np.zeros((40, 1)))
    onset = Signal(1, (Term(0, 0.0, np.inf, Constant(0.3)),))
    run = simulated(LOOP, 0.05, nothing, onset, onset, onset)
    for name in ("output", "control", "actuator_fault", "sensor_fault"):
        before, after = getattr(run.before, name), getattr(run.after, name)
        assert np.array_equal(before[0], after[0]), name
        assert after[0].any(), name
