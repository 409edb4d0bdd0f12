"""The models of the actuator, their sampling, and the plant that switches between them."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reobserve.core.discretisation import zero_order_hold
from reobserve.core.errors import InputError
from reobserve_papers.plants.hydraulic_actuator import MOTION, REALISATIONS, ActuatorModel, simulate
from tests.reobserve.observers.actuator_models import ACTUATOR, rounded

Array = NDArray[np.float64]

MODELS = {name: ActuatorModel(*pair) for name, pair in ACTUATOR.items()}
FREQUENCY = 200.0
# A held input: volts, over this many steps each.
VOLTS, HOLD = (1.5, -1.5, 0.4, 0.0, 1.0), 10


@pytest.mark.parametrize("mode", MODELS)
def test_markov_parameters_agree_with_long_division(mode: str) -> None:
    b, a = ([Fraction(repr(value)) for value in part] for part in ACTUATOR[mode])
    rest, exact = [*b, Fraction(0)], []
    for _ in range(4):
        first = rest[0]
        exact.append(first)
        rest = [*(r - first * c for r, c in zip(rest[1:], a, strict=True)), Fraction(0)]
    np.testing.assert_allclose(MODELS[mode].markov, [float(h) for h in exact], rtol=1e-14)


@pytest.mark.parametrize(
    ("mode", "gain"), [("normal", 0.9101), ("friction", 0.6178), ("leakage", 0.3749)]
)
def test_static_gains_agree_with_the_transfer_functions(mode: str, gain: float) -> None:
    assert MODELS[mode].gain == pytest.approx(gain, abs=5e-5)
    one = MODELS[mode].sampled("velocity", 1e-3, FREQUENCY)
    still = np.linalg.solve(np.eye(4) - one.A, one.B)
    assert (one.C @ still + one.D).item() == pytest.approx(MODELS[mode].gain, rel=1e-12)


# --- Sampling -----------------------------------------------------------------------------------


def observer_form(mode: str, state: Array, volts: float) -> Array:
    """The slope of y' = x2 - a1 y + b1 u, x2' = x3 - a2 y + b2 u, ... and of the integral of y.

    This form uses the printed coefficients directly, without Markov parameters.
    """
    b, a = (np.array(part) for part in ACTUATOR[mode])
    slope = b * volts - a * state[0]
    slope[:3] += state[1:4]
    return np.append(slope, state[0])


def motion_of(mode: str, state: Array, volts: float) -> Array:
    """Position, y, y', y'' while u is held."""
    a = ACTUATOR[mode][1]
    first = observer_form(mode, state, volts)
    second = first[1] - a[0] * first[0]
    return np.array([state[4], state[0], first[0], second])


def state_of(mode: str, motion: Array, volts: float, snap: float) -> Array:
    """The state with this position, y, y' and y'', and ``snap`` for y'''."""
    b, a = ACTUATOR[mode]
    position, y, first, second = motion
    x2 = first + a[0] * y - b[0] * volts
    x2_slope = second + a[0] * first
    x3 = x2_slope + a[1] * y - b[1] * volts
    x3_slope = snap + a[0] * second + a[1] * first
    x4 = x3_slope + a[2] * y - b[2] * volts
    return np.array([y, x2, x3, x4, position])


def snap_of(mode: str, state: Array, volts: float) -> float:
    """y''' while u is held."""
    a = ACTUATOR[mode][1]
    first = observer_form(mode, state, volts)
    second = observer_form(mode, first, 0.0)
    return float(second[1] - a[0] * second[0])


@cache
def integrated(schedule: tuple[tuple[str, float], ...], period: float) -> Array:
    """Motion at the end of each step by a method of order 8.

    Each entry of the schedule is the mode and the volts of a step. When the mode changes, y to y'''
    are handed over under the old volts; then the new ones apply.
    """
    state, snap, rows = np.zeros(5), 0.0, [np.zeros(4)]
    scales = np.array([1.0, 5e2, 3e5, 1e8, 1e-2])
    for k, (mode, volts) in enumerate(schedule):
        if k and schedule[k - 1][0] != mode:
            state = state_of(mode, rows[-1], schedule[k - 1][1], snap)
        found = solve_ivp(
            lambda _, x, mode=mode, volts=volts: observer_form(mode, x, volts),
            (0.0, period), state, method="DOP853", rtol=1e-12, atol=1e-14 * scales,
        )  # fmt: skip
        assert found.success
        state = found.y[:, -1]
        rows.append(motion_of(mode, state, volts))
        snap = snap_of(mode, state, volts)
    return np.array(rows)


def held(mode: str) -> tuple[tuple[str, float], ...]:
    return tuple((mode, volts) for volts in np.repeat(VOLTS, HOLD).tolist())


@pytest.mark.parametrize("realisation", REALISATIONS)
@pytest.mark.parametrize("mode", MODELS)
def test_samples_agree_with_the_transfer_function(mode: str, realisation: str) -> None:
    period = 2e-3
    motion = integrated(held(mode), period)
    wanted = dict(zip(MOTION, motion.T, strict=True))
    one = MODELS[mode].sampled(realisation, period, FREQUENCY)
    x, rows = np.zeros(len(one.A)), []
    for _, volts in held(mode):
        x = one.A @ x + one.B[:, 0] * volts
        rows.append(one.C @ x + one.D[:, 0] * volts)
    assert len(one.A) == (5 if realisation == "motion" else 4)
    for name, found in zip(REALISATIONS[realisation], np.array(rows).T, strict=True):
        value = wanted[name][1:]
        np.testing.assert_allclose(found, value, rtol=0, atol=1e-10 * np.abs(value).max())


@pytest.mark.parametrize("frequency", [50.0, 200.0, 1000.0])
@pytest.mark.parametrize("mode", MODELS)
def test_frequency_response_agrees_with_partial_fractions(mode: str, frequency: float) -> None:
    """Of each simple pole p with the residue r: r (z + ...) by its own exponential, 50 digits."""
    period = 1e-3
    with mpmath.workdps(50):
        T = mpmath.mpf(period)
        b, a = ([mpmath.mpf(value) for value in part] for part in ACTUATOR[mode])
        poles = mpmath.polyroots([1, *a], maxsteps=200, extraprec=200)
        residues = [
            mpmath.polyval(b, p) / mpmath.polyval([4, 3 * a[0], 2 * a[1], a[2]], p) for p in poles
        ]
        h1 = b[0]
        h2 = b[1] - a[0] * h1
        for angle in (0.01, 0.5, 3.0):
            z = mpmath.expj(angle)

            # The effect of a unit of u over a step on the k-th derivative of each pole's part.
            def part(k: int, z: Any = z) -> Any:
                return mpmath.fsum(
                    r * p ** (k - 1) * mpmath.expm1(p * T) * z / (z - mpmath.exp(p * T))
                    for r, p in zip(residues, poles, strict=True)
                )

            at_rest = -mpmath.fsum(r / p for r, p in zip(residues, poles, strict=True))
            wanted = {
                "position": part(-1) + at_rest * T * z / (z - 1),
                "velocity": part(0),
                "acceleration": h1 + part(1),
                "jerk": h2 + part(2),
            }
            for realisation, names in REALISATIONS.items():
                one = MODELS[mode].sampled(realisation, period, frequency)
                turn = complex(z)
                inner = np.linalg.solve(turn * np.eye(len(one.A)) - one.A, one.B)
                found = (one.C @ inner * turn + one.D)[:, 0]
                for name, value in zip(names, found, strict=True):
                    assert abs(value / complex(wanted[name]) - 1) < 1e-9, (realisation, name)


def test_outputs_do_not_depend_on_the_unit_of_the_states() -> None:
    parts = []
    for frequency in (50.0, 1000.0):
        one = MODELS["leakage"].sampled("motion", 5e-3, frequency)
        x = one.B[:, 0]
        rows = []
        for _ in range(20):
            rows.append(one.C @ x)
            x = one.A @ x
        parts.append(np.array(rows))
    size = np.abs(parts[0]).max(axis=0)
    np.testing.assert_allclose(parts[0] / size, parts[1] / size, rtol=0, atol=1e-11)


SINGULAR: dict[str, tuple[list[list[float]], list[list[float]]]] = {
    "zero": ([[0, 0], [0, 0]], [[1, 2], [3, 4]]),
    "two integrators": ([[0, 1], [0, 0]], [[0], [1]]),
    "an integrator before a lag": ([[0, 3, 0], [0, -2, 5], [0, -5, -2]], [[0], [1], [-7]]),
    "rank one": ([[1, 2], [2, 4]], [[2], [-1]]),
}


@pytest.mark.parametrize("case", SINGULAR)
def test_zero_order_hold_of_a_singular_system_is_exact(case: str) -> None:
    A, B = SINGULAR[case]
    assert np.linalg.det(A) == 0
    found = zero_order_hold(A, B, 0.37)
    for matrix, exact in zip(found, exact_hold(A, B, 0.37), strict=True):
        np.testing.assert_allclose(matrix, exact, rtol=1e-13, atol=1e-15)


def test_zero_order_hold_of_the_actuator_agrees_with_50_digits() -> None:
    one = MODELS["normal"].sampled("motion", 5e-3, FREQUENCY)
    A, B = np.zeros((5, 5)), np.zeros((5, 1))
    A[:4, 1:] = FREQUENCY * np.eye(4)
    A[4, 1:] = -np.array(ACTUATOR["normal"][1][::-1]) / FREQUENCY ** np.array([3, 2, 1, 0])
    B[1:, 0] = MODELS["normal"].markov / FREQUENCY ** np.arange(4)
    for matrix, exact in zip((one.A, one.B), exact_hold(A, B, 5e-3), strict=True):
        np.testing.assert_allclose(matrix, exact, rtol=0, atol=1e-13 * np.abs(exact).max())


def exact_hold(A: Any, B: Any, period: float) -> tuple[Array, Array]:
    """sum (A T)^k / k! and sum A^k B T^(k+1) / (k+1)!, until terms are below 50 digits."""
    with mpmath.workdps(50):
        a, b, T = mpmath.matrix(A), mpmath.matrix(B), mpmath.mpf(period)
        term = mpmath.eye(a.rows)
        transition, effect = 0 * term, 0 * b
        for k in range(1, 120):
            transition += term
            effect += term * b * (T / k)
            term = term * a * (T / k)
        assert mpmath.mnorm(term, 1) < mpmath.mpf(10) ** -45
        return rounded(transition), rounded(effect)


# --- The plant that switches --------------------------------------------------------------------

PAIR = (MODELS["normal"], MODELS["leakage"])
# The mode changes while the volts are held, back at a step of them, and once more in between.
MODES = np.repeat([0, 1, 0, 1], [15, 15, 6, 14])
CONTROL = np.repeat(VOLTS, HOLD)


def schedule_of(modes: Sequence[int] | NDArray[np.int64]) -> tuple[tuple[str, float], ...]:
    names = ("normal", "leakage")
    return tuple((names[m], u) for m, u in zip(modes, CONTROL.tolist(), strict=True))


@pytest.mark.parametrize("modes", [MODES, 0 * MODES, 0 * MODES + 1])
def test_motion_agrees_with_an_adaptive_integration(modes: NDArray[np.int64]) -> None:
    wanted = integrated(schedule_of(modes), 2e-3)
    found = simulate(PAIR, modes, CONTROL, 2e-3)
    size = np.abs(wanted).max(axis=0)
    np.testing.assert_allclose(found / size, wanted / size, rtol=0, atol=1e-10)


@pytest.mark.parametrize("change", [1003, 1010])
def test_motion_is_continuous_at_a_mode_change(change: int) -> None:
    """The limits from both sides, from polynomials through samples on either side of it."""
    period, rows = 1e-5, 1060
    control = np.full(rows, 1.5)
    control[:900] = -0.5
    mode = (np.arange(rows) >= change).astype(np.int64)
    motion = simulate(PAIR, mode, control, period)
    size = np.abs(motion).max(axis=0)
    places = np.arange(1, 9)
    left = extrapolated(motion[change - places])
    right = extrapolated(motion[change + places])
    np.testing.assert_allclose(right / size, left / size, rtol=0, atol=1e-10)
    np.testing.assert_allclose(right / size, motion[change] / size, rtol=0, atol=1e-10)
    # Precondition: something does change, the second derivative of the jerk.
    bends = [np.diff(motion[k : k + 3, 3], 2)[0] for k in (change - 2, change)]
    assert abs(bends[1] - bends[0]) > 0.01 * max(map(abs, bends))


def extrapolated(samples: Array) -> Array:
    """Extrapolate the polynomial through samples at 1 to n to 0."""
    n = len(samples)
    weights = [(-1) ** (k + 1) * float(mpmath.binomial(n, k)) for k in range(1, n + 1)]
    return np.asarray(weights) @ samples


def test_position_is_the_integral_of_velocity() -> None:
    """By a rule of order 6 with velocity, acceleration and jerk at both ends of each step."""
    period, rows = 2e-4, 500
    mode = (np.arange(rows) >= 260).astype(np.int64)
    position, velocity, acceleration, jerk = simulate(PAIR, mode, np.full(rows, 1.5), period).T
    moved = 0.5 * period * (velocity[1:] + velocity[:-1])
    moved -= period**2 / 10 * np.diff(acceleration)
    moved += period**3 / 120 * (jerk[1:] + jerk[:-1])
    # The first step begins with a jump of the input, and so of acceleration and jerk.
    found = np.cumsum(moved[1:])
    np.testing.assert_allclose(position[2:] - position[1], found, rtol=1e-10)


def test_no_mode_change_gives_a_single_model() -> None:
    leak = MODELS["leakage"]
    twice = simulate([leak, leak], MODES, CONTROL, 2e-3)
    once = simulate([leak], 0 * MODES, CONTROL, 2e-3)
    np.testing.assert_array_equal(twice, once)
    np.testing.assert_array_equal(simulate(PAIR, 0 * MODES + 1, CONTROL, 2e-3), once)


def test_plant_at_rest_without_input_stays_at_rest() -> None:
    assert not simulate(PAIR, MODES, 0 * CONTROL, 2e-3).any()


# --- Models in between, and bad input -----------------------------------------------------------


def test_blended_model_lies_in_between() -> None:
    normal, leakage = PAIR
    for share, end in ((0.0, normal), (1.0, leakage)):
        for found, wanted in zip(
            normal.blended(leakage, share).coefficients, end.coefficients, strict=True
        ):
            np.testing.assert_array_equal(found, wanted)
    numerator, denominator = normal.blended(leakage, 0.25).coefficients
    np.testing.assert_allclose(numerator, [20.8575, 7410.4, 1443250, 127050000], rtol=1e-14)
    np.testing.assert_allclose(denominator, [430.4, 62100, 4912500, 144777500], rtol=1e-14)


# (s + 0.1)^4 and (s + 10)^4: stable, and at a hundredth of the way a1 a2 < a3 (Routh).
SLOW, FAST = ([0.4, 0.06, 0.004, 0.0001], [40.0, 600.0, 4000.0, 10000.0])


def test_unstable_blend_is_refused() -> None:
    slow, fast = ActuatorModel([1, 1, 1, 1], SLOW), ActuatorModel([1, 1, 1, 1], FAST)
    a1, a2, a3, _ = (0.99 * s + 0.01 * f for s, f in zip(SLOW, FAST, strict=True))
    assert a1 * a2 < a3
    with pytest.raises(InputError, match=r"^denominator: has a pole with real part .* be stable$"):
        slow.blended(fast, 0.01)
    slow.blended(fast, 0.5)


BAD: dict[str, tuple[Any, str]] = {
    "three coefficients": (
        lambda: ActuatorModel([1, 2, 3], [1, 2, 3, 4]),
        r"numerator: has shape \(3,\), must be a list of 4 numbers",
    ),
    "a word": (
        lambda: ActuatorModel([1, 2, 3, 4], "fast"), r"denominator: 'fast' is not a number",
    ),
    "a pole on the right": (
        lambda: ActuatorModel([1, 2, 3, 4], [1, 2, 3, -4]),
        r"denominator: has a pole with real part 0.737796, must be stable",
    ),
    "a pole at the origin": (
        lambda: ActuatorModel([1, 2, 3, 4], [4, 6, 4, 0]),
        r"denominator: has a pole with real part 0, must be stable",
    ),
    "more than the whole way": (
        lambda: PAIR[0].blended(PAIR[1], 1.1), r"share: 1.1 must be from 0 to 1",
    ),
    "the wrong way": (lambda: PAIR[0].blended(PAIR[1], -0.1), r"share: -0.1 must be from 0 to 1"),
    "another realisation": (
        lambda: PAIR[0].sampled("pva", 1e-3, 200.0),
        r"realisation: 'pva' must be one of velocity, derivatives, motion",
    ),
    "a list for a realisation": (
        lambda: PAIR[0].sampled(["motion"], 1e-3, 200.0),
        r"realisation: \['motion'\] must be one of",
    ),
    "no period": (lambda: PAIR[0].sampled("motion", 0.0, 200.0), r"period: 0 must be greater"),
    "no frequency": (lambda: PAIR[0].sampled("motion", 1e-3, -1), r"frequency: -1 must be greater"),
    "a plant without a period": (
        lambda: simulate(PAIR, MODES, CONTROL, 0.0), r"period: 0 must be greater than zero",
    ),
    "modes too few": (
        lambda: simulate(PAIR, MODES[:-1], CONTROL, 1e-3),
        r"mode: has shape \(49,\), must be \(50,\) like control",
    ),
    "a mode that there is not": (
        lambda: simulate(PAIR, MODES + 1, CONTROL, 1e-3),
        r"mode: must be whole numbers from 0 to 1",
    ),
    "half a mode": (
        lambda: simulate(PAIR, 0.5 * MODES, CONTROL, 1e-3), r"mode: must be whole numbers",
    ),
    "a control of two columns": (
        lambda: simulate(PAIR, MODES, np.ones((50, 2)), 1e-3),
        r"control: has shape \(50, 2\), must be \(k,\)",
    ),
    "a control that is not finite": (
        lambda: simulate(PAIR, [0, 0], [1.0, np.nan], 1e-3),
        r"control: .* has an entry that is not finite",
    ),
    "a hold of no square matrix": (
        lambda: zero_order_hold([[1, 2]], [[1]], 1.0), r"A: has shape \(1, 2\), must be square",
    ),
    "a hold of other rows": (
        lambda: zero_order_hold([[1]], [[1], [2]], 1.0),
        r"B: has shape \(2, 1\), must have 1 rows like A",
    ),
    "a hold of no time": (lambda: zero_order_hold([[1]], [[1]], -2.0), r"period: -2 must be great"),
}  # fmt: skip


@pytest.mark.parametrize("case", BAD)
def test_invalid_input_is_refused(case: str) -> None:
    call, sentence = BAD[case]
    with pytest.raises(InputError, match=f"^{sentence}"):
        call()


def test_reference_is_continuous_at_a_mode_change() -> None:
    """Check of the reference itself."""
    state = np.array([0.3, 20.0, -5e4, 3e6, 0.1])
    motion, snap = motion_of("leakage", state, 0.7), snap_of("leakage", state, 0.7)
    np.testing.assert_allclose(state_of("leakage", motion, 0.7, snap), state, rtol=1e-12)


def test_continuous_quantities_follow_the_chosen_handover() -> None:
    period, models = 1e-3, [MODELS["normal"], MODELS["leakage"]]
    mode, control = np.repeat([0, 1], 400), np.full(800, 1.5)
    runs = {
        way: simulate(models, mode, control, period, way) for way in ("motion", "states", "outputs")
    }
    jumps = {way: np.abs(run[401] - run[400]) for way, run in runs.items()}
    gains = [model.gain * 1.5 for model in models]
    for way, run in runs.items():
        np.testing.assert_array_equal(run[:401], runs["motion"][:401])
        assert run[-1, 1] == pytest.approx(gains[1], rel=1e-3), way
        assert jumps[way][0] == pytest.approx(gains[0] * period, rel=0.7), way
    # At rest the derivatives are zero, and the velocity is (14) of one of the models.
    assert jumps["motion"][1] < 1e-2 * gains[0]
    first = (models[0].markov[0] - models[1].markov[0]) * 1.5
    assert runs["states"][401, 2] == pytest.approx(-first, rel=0.2)
    assert abs(runs["motion"][401, 2]) < 0.2 * first
    assert jumps["outputs"][1] == pytest.approx(gains[0] - gains[1], rel=1e-3)


def test_unknown_handover_is_refused() -> None:
    with pytest.raises(InputError, match="'speed' must be one of motion, states, outputs"):
        simulate([MODELS["normal"]], [0], [1.0], 1e-3, "speed")
