"""Plants with a delayed input: adaptive references, closed forms, energy, order, and bad input."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reobserve.core.errors import DivergenceError, InputError
from reobserve.core.vector_field import vector_field
from reobserve.systems.triangular import TriangularModel
from reobserve_papers.plants.delayed_input import DelayedInputPlant, check_delay, delayed
from reobserve_papers.plants.first_order_lag import first_order_lag
from reobserve_papers.plants.pendulum import pendulum
from reobserve_papers.signals.inputs import Signal
from tests.reobserve.observers.small_plants import DELAYS, MEET, START, pendulum_slope

Array = NDArray[np.float64]

# The pendulum of the paper: m/s^2, m, kg, kg/s; the largest static torque is m g l = 0.981 N m.
GRAVITY, LENGTH, MASS, FRICTION = 9.81, 0.5, 0.2, 0.3
PENDULUM = DelayedInputPlant(pendulum(GRAVITY, LENGTH, MASS, FRICTION))
LAG = DelayedInputPlant(first_order_lag())


def signal(*terms: dict[str, Any]) -> Signal:
    return Signal.parse("signal", [{"axis": 1, **term} for term in terms], 1)


def constant(size: float, **span: float) -> dict[str, Any]:
    return {"kind": "constant", "size": size, **span}


def sine(amplitude: float, frequency: float, **rest: float) -> dict[str, Any]:
    return {"kind": "sine", "amplitude": amplitude, "frequency": frequency, **rest}


EARLY = {"from": -1.5}
PROFILE = signal(
    constant(0.6, until=20),
    constant(1.2, **{"from": 20}, until=40),
    constant(0.3, **{"from": 40}, until=60),
    constant(0.8, **{"from": 60}),
    sine(0.45, 0.2, **{"from": 60}),
)
RAMP = signal(constant(0.009 * -1.5, **EARLY), {"kind": "ramp", "slope": 0.009, **EARLY})
SINE = signal(sine(1.0, 0.2, **EARLY))
INPUTS: dict[str, tuple[Signal, Callable[[float], float]]] = {
    "ramp": (RAMP, lambda t: 0.009 * t),
    "sine": (SINE, lambda t: float(np.sin(0.2 * t))),
}


def lag_slope(x: Array, u: float) -> Array:
    return -x + u


PLANTS = {"pendulum": (PENDULUM, pendulum_slope, START), "lag": (LAG, lag_slope, (0.4,))}


@cache
def reference(plant: str, applied: str) -> Array:
    """States at whole seconds by a method of order 8, restarted at each of them.

    So it never steps over a jump of the delay, and its last step in each second ends there.
    """
    _, slope, state = PLANTS[plant]
    u = INPUTS[applied][1]
    states = [np.array(state)]
    for tau, (begin, end) in zip(DELAYS, pairwise(MEET), strict=True):
        for second in range(begin, end):
            found = solve_ivp(
                lambda t, x, tau=tau: slope(x, u(t - tau(t))),
                (second, second + 1), states[-1], method="DOP853", rtol=1e-12, atol=1e-14,
            )  # fmt: skip
            assert found.success
            states.append(found.y[:, -1])
    return np.array(states)


def simulated(plant: str, applied: str) -> Array:
    simulator, _, start = PLANTS[plant]
    return simulator.simulate(start, INPUTS[applied][0], PROFILE, 1e-3, 120000)


# --- Against an adaptive method, and the order of convergence -----------------------------------


@pytest.mark.parametrize("applied", INPUTS)
@pytest.mark.parametrize("plant", PLANTS)
def test_agrees_with_an_adaptive_method_over_the_profile(plant: str, applied: str) -> None:
    # Measured 6.4e-10 at most, where the pendulum turns fast; for the lag only rounding.
    gap = simulated(plant, applied)[::1000] - reference(plant, applied)
    assert np.max(np.abs(gap)) < 1e-9


def test_order_is_four_with_jumps_on_the_grid() -> None:
    delay = signal(
        constant(0.6, until=1),
        constant(1.2, **{"from": 1}, until=2),
        constant(0.3, **{"from": 2}, until=3),
        constant(0.8, **{"from": 3}),
        sine(0.45, 2.0, **{"from": 3}),
    )
    applied = signal(sine(1.0, 3.0, phase=0.5))

    def tau(t: float, inside: float) -> float:
        return (0.6, 1.2, 0.3, 0.8 + 0.45 * float(np.sin(2 * t)))[int(inside)]

    # The control starts with a jump at t = 0, which arrives at 0.6 s, and again at 1.2 s.
    meet = (0.0, 0.6, 1.0, 1.2, 2.0, 3.0, 4.0)
    states = [np.array(START)]
    for begin, end in pairwise(meet):
        inside = 0.5 * (begin + end)
        on = inside - tau(inside, inside) > 0

        def slope(t: float, x: Array, inside: float = inside, on: bool = on) -> Array:
            u = float(np.sin(3 * (t - tau(t, inside)) + 0.5)) if on else 0.0
            return pendulum_slope(x, u)

        span, start = (begin, end), states[-1]
        found = solve_ivp(slope, span, start, method="DOP853", rtol=1e-13, atol=1e-15)
        states.append(found.y[:, -1])
    steps = 0.1 / 2.0 ** np.arange(4, 8)
    errors = []
    for step in steps:
        run = PENDULUM.simulate(START, applied, delay, step, round(4 / step))
        rows = np.round(np.array(meet) / step).astype(int)
        errors.append(np.max(np.abs(run[rows] - states)))
    slopes = np.diff(np.log(errors)) / np.diff(np.log(steps))
    assert np.all((slopes > 3.9) & (slopes < 4.1)), slopes


# --- Closed forms -------------------------------------------------------------------------------


def test_lag_with_constant_delay_agrees_with_closed_form() -> None:
    a, b, w, tau = 1.7, -0.6, 2.0, 0.4
    plant = DelayedInputPlant(first_order_lag(a, b))
    states = plant.simulate([0.3], signal(sine(1.0, w, **EARLY)), signal(constant(tau)), 1e-3, 9000)
    time = np.arange(9001) * 1e-3

    def forced(t: Array) -> Array:
        angle = w * (t - tau)
        return b / (a**2 + w**2) * (a * np.sin(angle) - w * np.cos(angle))

    expected = forced(time) + (0.3 - forced(np.zeros(1))) * np.exp(-a * time)
    assert states[:, 0] == pytest.approx(expected, abs=1e-12)


def test_input_has_no_effect_before_its_delay() -> None:
    # A step at 0.5 s, 1.2 s late; x = 1 - exp(-(t - 1.7)) from then on.
    step = signal(constant(1.0, **{"from": 0.5}))
    states = LAG.simulate([0.0], step, signal(constant(1.2)), 0.01, 400)
    time = np.arange(401) * 0.01
    assert not states[:171].any()
    assert states[171:, 0] == pytest.approx(-np.expm1(-(time[171:] - 1.7)), abs=1e-10)


def test_delay_jump_acts_immediately() -> None:
    # u = t; the delay falls from 1 to 0 at t = 1, and the slope of x jumps by u(1) - u(0).
    late = signal(constant(1.0, until=1))
    ramp = signal({"kind": "ramp", "slope": 1.0, "from": -2}, constant(-2.0, **{"from": -2}))
    states = LAG.simulate([-2.0], ramp, late, 0.01, 200)[:, 0]
    time = np.arange(201) * 0.01
    assert states[:101] == pytest.approx(time[:101] - 2, abs=1e-12)  # x = t - 2 solves x' = -x+t-1
    after = time[100:]
    assert states[100:] == pytest.approx(after - 1 - np.exp(1 - after), abs=1e-10)


@pytest.mark.parametrize("friction", [0.0, FRICTION])
def test_pendulum_is_linear_at_small_angles(friction: float) -> None:
    plant = DelayedInputPlant(pendulum(GRAVITY, LENGTH, MASS, friction))
    nothing, none = signal(), signal(constant(0.0))
    time = np.arange(4001) * 1e-3
    damping = 0.5 * friction / MASS
    omega = np.sqrt(GRAVITY / LENGTH - damping**2)
    shape = np.exp(-damping * time) * (
        np.cos(omega * time) + damping / omega * np.sin(omega * time)
    )
    gaps = []
    for angle in (0.02, 0.01):
        states = plant.simulate([angle, 0.0], nothing, none, 1e-3, 4000)
        gaps.append(np.max(np.abs(states[:, 0] - angle * shape)))
    # The rest is the cubic term of the sine: the frequency falls by angle^2/16 of it.
    assert gaps[0] < 1.05 * 0.02**3 / 16 * omega * 4
    assert gaps[0] / gaps[1] == pytest.approx(8, rel=0.02)


def test_small_torque_balances_gravity_at_rest() -> None:
    torque = 0.5
    applied = signal(constant(torque, **EARLY))
    states = PENDULUM.simulate([0.5, 0.0], applied, signal(constant(0.6)), 1e-2, 4000)
    assert np.sin(states[-1, 0]) == pytest.approx(torque / (MASS * GRAVITY * LENGTH), rel=1e-9)


@pytest.mark.parametrize("friction", [0.0, FRICTION])
def test_energy_is_lost_only_to_friction(friction: float) -> None:
    """The power of a force k v is k v^2 with v = l x2: this is why the friction enters as k/m."""
    plant = DelayedInputPlant(pendulum(GRAVITY, LENGTH, MASS, friction))
    states = plant.simulate([3.0, 0.0], signal(), signal(constant(0.6)), 1e-3, 20000)
    speed = LENGTH * states[:, 1]
    energy = 0.5 * MASS * speed**2 + MASS * GRAVITY * LENGTH * (1 - np.cos(states[:, 0]))
    lost = cumulative(friction * speed**2, 2e-3)
    assert energy[::2] + lost == pytest.approx(np.full(10001, energy[0]), abs=1e-9)
    assert np.ptp(energy) > (0.9 * energy[0] if friction else 0.0)


def cumulative(values: Array, interval: float) -> Array:
    """Simpson's rule from the start to every second sample."""
    parts = (values[:-2:2] + 4 * values[1:-1:2] + values[2::2]) * interval / 6
    return np.concatenate([[0.0], np.cumsum(parts)])


@vector_field
def _chain_drift(x: Array, parameters: Array, f: Array) -> None:
    f[0] = 0.0
    f[1] = -x[1]
    f[2] = parameters[0]


@vector_field
def _chain_gain(y: Array, parameters: Array, G: Array) -> None:
    G[0] = y[0]


def test_user_defined_model_with_output_dependent_gain_agrees_with_scipy() -> None:
    """Three states: the shift, a drift in each row and G(y) = y against scipy."""
    plant = DelayedInputPlant(TriangularModel(3, _chain_drift, _chain_gain, np.array([-0.3])))
    states = plant.simulate([0.5, -0.2, 0.1], SINE, signal(constant(0.7)), 1e-3, 3000)

    def slope(t: float, x: Array) -> Array:
        return np.array([x[1], x[2] - x[1], -0.3 + x[0] * np.sin(0.2 * (t - 0.7))])

    found = solve_ivp(slope, (0, 3), [0.5, -0.2, 0.1], method="DOP853", rtol=1e-12, atol=1e-14)
    assert states[-1] == pytest.approx(found.y[:, -1], abs=1e-12)


# --- The pendulum of the paper turns over -------------------------------------------------------


def first_time(condition: NDArray[np.bool_], after: float = 1.0) -> float:
    time = np.arange(len(condition)) * 1e-3
    return float(time[np.flatnonzero(condition & (time > after))[0]])


def test_ramp_ends_above_the_largest_static_torque() -> None:
    largest = MASS * GRAVITY * LENGTH
    assert largest == pytest.approx(0.981)
    assert 0.009 * (109 + 1e-9) > largest > 0.009 * (109 - 1e-9)
    angle = simulated("pendulum", "ramp")[:, 0]
    horizontal, upright = first_time(np.abs(angle) > np.pi / 2), first_time(np.abs(angle) > np.pi)
    assert horizontal == pytest.approx(111.088, abs=2e-3)
    assert upright == pytest.approx(113.325, abs=2e-3)
    # Before, it follows the torque; afterwards it spins, 14.5 turns by 120 s.
    assert angle[-1] == pytest.approx(90.7637, abs=1e-4)
    assert np.all(np.diff(angle[110000:]) > 0)


def test_sine_turns_the_pendulum_over_both_ways() -> None:
    # Its amplitude is 2 % above the largest static torque.
    angle = simulated("pendulum", "sine")[:, 0]
    assert first_time(np.abs(angle) > np.pi / 2) == pytest.approx(8.339, abs=2e-3)
    assert first_time(np.abs(angle) > np.pi) == pytest.approx(10.581, abs=2e-3)
    assert np.max(angle) == pytest.approx(39.9662, abs=1e-4)
    assert np.min(angle) == pytest.approx(-51.8663, abs=1e-4)
    assert angle[-1] == pytest.approx(-15.0167, abs=1e-4)


# --- The delayed control and its limits ---------------------------------------------------------


def test_delayed_control_equals_the_earlier_control() -> None:
    time = np.linspace(0, 120, 4801)
    for applied, u in INPUTS.values():
        # At the jumps themselves from the right, as the profile is stated.
        pieces = np.minimum(np.searchsorted((20, 40, 60), time, side="right"), 3)
        expected = [u(t - DELAYS[k](t)) for t, k in zip(time, pieces, strict=True)]
        assert delayed(applied, PROFILE, time) == pytest.approx(expected, abs=1e-14)


def test_delayed_control_has_two_limits_at_jumps() -> None:
    at = np.array([20.0, 40.0, 60.0])
    left = delayed(SINE, PROFILE, at, before=True)
    right = delayed(SINE, PROFILE, at)
    assert left == pytest.approx(np.sin(0.2 * (at - [0.6, 1.2, 0.3])), abs=1e-15)
    last = 0.8 + 0.45 * np.sin(12.0)
    assert right == pytest.approx(np.sin(0.2 * (at - [1.2, 0.3, last])), abs=1e-15)
    # A step of the control at 0.5 s arrives at 1.1 s.
    step = signal(constant(2.0, **{"from": 0.5}))
    arrival = np.array([1.1])
    assert delayed(step, PROFILE, arrival, before=True)[0] == 0
    assert delayed(step, PROFILE, arrival)[0] == 2


# --- Bad input ----------------------------------------------------------------------------------


def test_delay_outside_its_interval_is_refused() -> None:
    check_delay("plant.delay", PROFILE, (0.0, 1.5), 1e-3, 120.0)
    check_delay("plant.delay", PROFILE, (0.3, 1.25), 1e-3, 120.0)  # its bounds are allowed
    with pytest.raises(
        InputError, match=r"^plant.delay: is 1.2 s at t = 20 s, must be from 0 to 1 s$"
    ):
        check_delay("plant.delay", PROFILE, (0.0, 1.0), 1e-3, 120.0)
    check_delay("plant.delay", PROFILE, (0.0, 1.0), 1e-3, 20.0)  # it comes after the end
    with pytest.raises(
        InputError, match=r"^delay: is 0.3 s at t = 40 s, must be from 0.5 to 1.5 s$"
    ):
        check_delay("delay", PROFILE, (0.5, 1.5), 1e-3, 120.0)
    # Between the ends of steps and at their left limits it is checked too.
    peak = signal(constant(1.0), sine(0.6, np.pi, **{"from": 0}))
    with pytest.raises(InputError, match=r"^delay: is 1.6 s at t = 0.5 s, must be from 0 to 1.5 s"):
        check_delay("delay", peak, (0.0, 1.5), 1.0, 2.0)
    end = signal({"kind": "ramp", "slope": 2.0, "until": 1})
    with pytest.raises(InputError, match=r"^delay: is 2 s at t = 1 s, must be from 0 to 1.5 s$"):
        check_delay("delay", end, (0.0, 1.5), 1.0, 2.0)


def test_delay_jump_off_the_grid_is_refused() -> None:
    with pytest.raises(
        InputError,
        match=r"^delay: jumps at 20 s, must jump at a multiple of 0.3 s .* 19.8 and 20.1 s\)$",
    ):
        check_delay("delay", PROFILE, (0.0, 1.5), 0.3, 120.0)
    with pytest.raises(InputError, match=r"^delay: jumps at 20 s"):
        LAG.simulate([0.0], SINE, PROFILE, 0.3, 400)
    check_delay("delay", PROFILE, (0.0, 1.5), 0.3, 18.0)


def test_negative_delay_is_refused() -> None:
    ahead = signal(constant(0.2), sine(0.3, 1.0))
    with pytest.raises(InputError, match=r"^delay: is -0.\d+ s at t = 3.9 s, must be 0 or more$"):
        LAG.simulate([0.0], SINE, ahead, 0.1, 100)


def test_control_jump_inside_a_step_is_refused() -> None:
    late = signal(constant(1.0, **{"from": 0.25}))
    LAG.simulate([0.0], late, signal(constant(0.65)), 0.1, 20)
    with pytest.raises(
        InputError,
        match=r"^control: jumps or bends at 0.25 s, which arrives inside the step from 0.8 to "
        r"0.9 s, must arrive at a multiple of the step$",
    ):
        LAG.simulate([0.0], late, signal(constant(0.6)), 0.1, 20)
    # The end of a history also counts, and so does a break that only the midpoint of a step has
    # passed.
    history = signal(constant(1.0, **{"from": -1}, until=-0.05))
    with pytest.raises(
        InputError, match=r"^control: jumps or bends at -0.05 s, .* from 0.5 to 0.6"
    ):
        LAG.simulate([0.0], history, signal(constant(0.6)), 0.1, 20)
    wave = signal(constant(1.0), sine(1.0, 2 * np.pi))
    with pytest.raises(InputError, match=r"^control: jumps or bends at"):
        LAG.simulate([0.0], signal(constant(1.0, **{"from": -0.8})), wave, 1.0, 3)
    # A control that starts long before its first use has no break.
    LAG.simulate([0.0], SINE, PROFILE, 0.1, 1200)


def test_delayed_time_running_backwards_over_a_jump_is_refused() -> None:
    """The delay grows by 2 s per second: the control arrives in reverse order.

    At 0.5 s, on the grid, the limit from inside the step before it would be that of the control
    from the right.
    """
    growing = signal({"kind": "ramp", "slope": 2.0})
    jump = signal(constant(1.0, **{"from": -1}, until=-0.5))
    with pytest.raises(InputError, match=r"^control: jumps or bends at -0.5 s, .* from 0.4 to 0.5"):
        LAG.simulate([0.0], jump, growing, 0.1, 10)
    smooth = LAG.simulate([0.0], signal(constant(1.0, **{"from": -9})), growing, 0.1, 10)
    assert smooth[-1, 0] == pytest.approx(-np.expm1(-1.0), abs=1e-6)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"initial_state": [0.0]}, r"^initial_state: has shape \(1,\), must be a list of 2 "),
        ({"initial_state": 0.0}, r"^initial_state: has shape \(\), must be a list of 2 numbers$"),
        ({"step": 0.0}, r"^step: 0 must be greater than zero$"),
        ({"step": -0.1}, r"^step: -0.1 must be greater than zero$"),
        ({"steps": 0}, r"^steps: 0 must be a whole number, from 1 to 10000000$"),
        ({"control": Signal(2, ())}, r"^control: has 2 axes, must have 1$"),
        ({"delay": Signal(3, ())}, r"^delay: has 3 axes, must have 1$"),
    ],
)  # fmt: skip
def test_invalid_input_is_refused_in_one_sentence(change: dict[str, Any], sentence: str) -> None:
    good: dict[str, Any] = {
        "initial_state": START, "control": SINE, "delay": PROFILE, "step": 0.1, "steps": 10,
    }  # fmt: skip
    PENDULUM.simulate(**good)
    with pytest.raises(InputError, match=sentence):
        PENDULUM.simulate(**{**good, **change})


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: pendulum(0, 1, 1, 1), r"^gravity: 0 must be greater than zero$"),
        (lambda: pendulum(1, -2, 1, 1), r"^length: -2 must be greater than zero$"),
        (lambda: pendulum(1, 1, 0, 1), r"^mass: 0 must be greater than zero$"),
        (lambda: pendulum(1, 1, 1, -0.1), r"^friction: -0.1 kg/s must not be negative$"),
        (lambda: first_order_lag(0), r"^rate: 0 must be greater than zero$"),
        (lambda: first_order_lag(1, 0), r"^gain: 0 must not be zero: no input would reach"),
    ],
)
def test_invalid_parameters_are_refused_in_one_sentence(
    make: Callable[[], TriangularModel], sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        make()


@vector_field
def _explosive_drift(x: Array, parameters: Array, f: Array) -> None:
    f[0] = x[0] ** 2


@vector_field
def _no_gain(y: Array, parameters: Array, G: Array) -> None:
    G[0] = 0.0


def test_divergence_is_reported_with_its_time() -> None:
    """From x(0) = 1, x' = x^2 has no solution after t = 1."""
    plant = DelayedInputPlant(TriangularModel(1, _explosive_drift, _no_gain, np.zeros(0)))
    with pytest.raises(
        DivergenceError, match=r"^plant diverged: its state is finite up to"
    ) as error:
        plant.simulate([1.0], signal(), signal(), 1e-3, 2000)
    assert 1.0 <= error.value.time < 1.02


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"gravity": 0.0}, "gravity"),
        ({"length": -1.0}, "length"),
        ({"mass": 0.0}, "mass"),
        ({"friction": -1e-9}, "friction: -1e-09 kg/s must not be negative"),
        ({"friction": float("nan")}, "friction"),
    ],
)
def test_invalid_pendulum_is_refused(wrong: dict[str, float], said: str) -> None:
    good = {"gravity": GRAVITY, "length": LENGTH, "mass": MASS, "friction": FRICTION}
    with pytest.raises(InputError, match=f"^{said}"):
        pendulum(**{**good, **wrong})
