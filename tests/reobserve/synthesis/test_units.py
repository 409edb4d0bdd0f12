"""The same system in other units has the transformed gains, or the same refusal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp
from numpy.typing import NDArray

from reobserve.core.covariances import as_covariance
from reobserve.core.errors import InputError
from reobserve.observers.fixed_gain import filter_gain, luenberger, steady_kalman
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.extended_state import pd_pi, pi
from reobserve.synthesis.extended_state.certificate import certify
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains
from reobserve.synthesis.h_infinity_norm import h_infinity_norm
from reobserve.synthesis.linear_gain import ackermann, kalman_gain_error, place, unobservable_modes
from reobserve.synthesis.normal_form.placement import injection_for
from reobserve.synthesis.normal_form.transform import normal_form
from reobserve.systems.linear import LinearModel
from reobserve.systems.polynomial import PolynomialSystem

Array = NDArray[np.float64]

AGREE = 1e-6
STATES, OUTPUTS = 3, 2
POWERS = st.integers(-9, 9)
SEEDS = st.integers(0, 10_000)
STATE_UNITS = st.lists(POWERS, min_size=STATES, max_size=STATES).map(lambda p: 10.0 ** np.array(p))
OUTPUT_UNITS = st.lists(POWERS, min_size=OUTPUTS, max_size=OUTPUTS).map(
    lambda p: 10.0 ** np.array(p)
)


def answer(call: Callable[[], Any]) -> Any:
    """What a call returns, or the first words of its refusal, without numbers."""
    try:
        return call()
    except InputError as error:
        return "".join(letter for letter in str(error) if letter not in "0123456789.e+-")


def same_gains(found: Any, expected: Any, rows: Array, columns: Array) -> None:
    """Refused alike, or equal in the units of ``expected``."""
    if isinstance(expected, str) or isinstance(found, str):
        assert found == expected
        return
    back = found * columns / rows[:, None]
    assert back == pytest.approx(expected, rel=AGREE, abs=AGREE * np.abs(expected).max())


def random_pair(seed: int, outputs: int = OUTPUTS) -> tuple[Array, Array]:
    """A stable or unstable system, in one of four with a mode that may be unobservable."""
    draw = np.random.default_rng(seed)
    A, C = draw.normal(size=(STATES, STATES)), draw.normal(size=(outputs, STATES))
    A /= np.abs(np.linalg.eigvals(A)).max() / draw.uniform(0.5, 1.1)
    if seed % 4 == 0:
        A[:-1, -1], C[:, -1] = 0.0, 0.0
    return A, C


# --- Gains ---------------------------------------------------------------------------------------


@given(SEEDS, STATE_UNITS, OUTPUT_UNITS)
def test_steady_gain_is_that_of_any_units(seed: int, x: Array, y: Array) -> None:
    (A, C), draw = random_pair(seed), np.random.default_rng(seed)
    G = draw.normal(size=(STATES, STATES))
    Q, R = 10.0 ** draw.uniform(-8, 0) * G @ G.T, np.diag(10.0 ** draw.uniform(-3, 3, OUTPUTS))
    one = LinearModel(A, None, C, None, Q=Q, R=R, check=False)
    other = LinearModel(
        x[:, None] * A / x, None, y[:, None] * C / x, None,
        Q=x[:, None] * Q * x, R=y[:, None] * R * y, check=False,
    )  # fmt: skip
    expected = answer(lambda: steady_kalman(one).gain)
    found = answer(lambda: steady_kalman(other).gain)
    same_gains(found, expected, x, y)
    if not isinstance(found, str):
        assert kalman_gain_error(other, found).max() < AGREE
        assert kalman_gain_error(other, found * 1.01).max() > AGREE


def exact_gain(A: list[list[float]], C: list[float], Q: list[float], r: float) -> Array:
    """The steady gain of one output in 50 digits, by doubling."""
    with mp.workdps(50):
        n = len(A)
        F, row = mp.matrix(A).T, mp.matrix([C])
        G, H = row.T * row / mp.mpf(r), mp.diag([mp.mpf(q) for q in Q])
        for _ in range(40):
            W = (mp.eye(n) + G * H) ** -1
            F, G, H = F * W * F, G + F * W * G * F.T, H + F.T * H * W * F
        gain = H * row.T / (row * H * row.T + mp.mpf(r))[0]
        return np.array([[float(entry)] for entry in gain])


@pytest.mark.parametrize(
    ("A", "C", "Q", "R"),
    [
        ([[1.0, 1e-4], [0.0, 1.0]], [1e-7, 0.0], [1e-24, 1e-14], 1e-36),  # m by F, 1 aF of noise
        ([[1.0, 0.1], [0.0, 0.9]], [1e-6, 0.0], [1e-12, 1e-10], 1e-24),  # W by A, 1 pA
        ([[1.0, 0.01], [0.0, 1.0]], [1e12, 0.0], [1e-10, 1e-6], 1e20),
        ([[1.0, 1.0], [0.0, 1.0]], [1.0, 0.0], [1e-18, 1e-26], 1e-12),  # a clock, in seconds
        ([[1.0, 1e-10], [0.0, 1.0]], [1.0, 0.0], [1e-10, 1e10], 1e-4),
    ],
)
def test_steady_gain_agrees_with_fifty_digits(A: Any, C: Any, Q: Any, R: float) -> None:
    model = LinearModel(A, None, [C], None, Q=Q, R=R)
    assert steady_kalman(model).gain == pytest.approx(exact_gain(A, C, Q, R), rel=AGREE)


@given(SEEDS, STATE_UNITS, OUTPUT_UNITS)
def test_placed_gains_are_those_of_any_units(seed: int, x: Array, y: Array) -> None:
    (A, C), poles = random_pair(seed), np.random.default_rng(seed).uniform(-0.9, 0.9, STATES)
    a, c = x[:, None] * A / x, y[:, None] * C / x
    same_gains(answer(lambda: place(a, c, poles)), answer(lambda: place(A, C, poles)), x, y)
    one, other = (
        LinearModel(pair[0], C=pair[1], Q=0.0, R=1.0, check=False) for pair in ((A, C), (a, c))
    )
    expected = answer(lambda: luenberger(one, poles).gain)
    same_gains(answer(lambda: luenberger(other, poles).gain), expected, x, y)


@given(SEEDS, STATE_UNITS, POWERS)
def test_single_output_gain_is_that_of_any_units(seed: int, x: Array, power: int) -> None:
    (A, C), y = random_pair(4 * seed + 1, 1), np.array([10.0**power])
    poles = np.array([0.5, -0.1 + 0.3j, -0.1 - 0.3j])
    a, c = x[:, None] * A / x, y[:, None] * C / x
    same_gains(place(a, c, poles), ackermann(A.T, C.T, poles).T, x, y)
    same_gains(ackermann(a.T, c.T, poles).T, place(A, C, poles), x, y)


@given(SEEDS, STATE_UNITS, OUTPUT_UNITS)
def test_unobservable_modes_are_those_of_any_units(seed: int, x: Array, y: Array) -> None:
    A, C = random_pair(seed)
    hidden = unobservable_modes(x[:, None] * A / x, y[:, None] * C / x)
    assert hidden == pytest.approx(unobservable_modes(A, C), rel=AGREE)
    assert len(hidden) == (seed % 4 == 0)


def test_gains_of_predictor_and_filter_form_are_distinguished() -> None:
    model = LinearModel([[1.0, 0.1], [0.0, 0.9]], None, [[1.0, 0.0]], None, Q=[1e-4, 1e-3], R=1e-2)
    filtering = steady_kalman(model).gain
    assert filter_gain(model, model.A @ filtering) == pytest.approx(filtering, rel=1e-12)
    delay = LinearModel(
        [[0.0, 0.0], [1.0, 0.0]], None, [[0.0, 1.0]], None, Q=1.0, R=1.0, check=False
    )
    with pytest.raises(InputError, match=r"^predictor_gain: is no A L: A is singular"):
        filter_gain(delay, [[1.0], [0.0]])


# --- Covariances ---------------------------------------------------------------------------------


@given(SEEDS, STATE_UNITS)
def test_covariances_are_accepted_in_any_units(seed: int, x: Array) -> None:
    draw = np.random.default_rng(seed)
    G = draw.normal(size=(STATES, STATES - seed % 2))  # every other one is singular
    good = G @ G.T
    bad = good - 1e-3 * np.trace(good) * np.eye(STATES)
    low = bool(np.linalg.eigvalsh(bad)[0] < -1e-6)
    for matrix, expected in ((good, True), (bad, not low)):
        other = x[:, None] * matrix * x
        assert is_covariance(other, definite=False) == expected
    assert is_covariance(x[:, None] * good * x, definite=True) == (seed % 2 == 0)


def is_covariance(matrix: Array, definite: bool) -> bool:
    try:
        as_covariance("it", matrix, len(matrix), definite=definite)
    except InputError:
        return False
    return True


@given(st.integers(-15, 15))
def test_a_negative_variance_is_none_in_any_units(power: int) -> None:
    with pytest.raises(InputError, match=r"^Q: must be positive semidefinite"):
        LinearModel(np.eye(2), None, [[1.0, 0.0]], None, Q=[1.0, -(10.0**power)], R=1.0)


# --- The H-infinity norm -------------------------------------------------------------------------


@given(SEEDS, STATE_UNITS)
def test_h_infinity_norm_does_not_depend_on_units_of_states(seed: int, x: Array) -> None:
    draw = np.random.default_rng(seed)
    A = draw.normal(size=(STATES, STATES)) - 4.0 * np.eye(STATES)
    B, C = draw.normal(size=(STATES, 1)), draw.normal(size=(1, STATES))
    expected = h_infinity_norm(A, B, C)
    found = h_infinity_norm(x[:, None] * A / x, x[:, None] * B, C / x)
    assert found.upper == pytest.approx(expected.upper, rel=1e-9)
    assert found.lower == pytest.approx(expected.lower, rel=1e-9)


# --- Extended state observers --------------------------------------------------------------------


def motor(speed: float = 1.0, current: float = 1.0, Az: float = 1.0) -> AugmentedSystem:
    """A motor whose speed and current are given in these units."""
    T, back = np.diag([speed, current]), np.diag([1.0 / speed, 1.0 / current])
    return AugmentedSystem(
        A=T @ [[-10.0, 1.0], [-0.02, -2.0]] @ back, B=T @ [[0.0], [2.0]], C=np.eye(2),
        Dd=T @ [[1.0, 0.0], [0.0, 2.0]], Dw=T @ [[1.0], [0.0]], Fa=T @ [[0.0], [2.0]],
        Fs=T @ [[1.0], [0.0]], Az=Az,
    )  # fmt: skip


def transformed(gains: Gains, speed: float, current: float) -> Gains:
    scale = np.array([speed, current])
    rows = np.array([*scale, *scale, 1.0, 1.0])[:, None]
    return Gains(rows * gains.L / scale, rows * gains.Ld / scale)


@pytest.fixture(scope="module")
def base() -> Gains:
    return pd_pi.design(motor()).gains


@pytest.mark.parametrize("factor", [1.05, 10.0])
@pytest.mark.parametrize(
    ("speed", "current"),
    [(1e3, 1.0), (1.0, 1e-3), (1e-3, 1.0), (1e-6, 1e6), (1e9, 1e-9), (1e-9, 1e9)],
)
def test_gains_are_found_where_they_are_known(
    speed: float, current: float, factor: float, base: Gains
) -> None:
    system = motor(speed, current)
    known = certify(system, transformed(base, speed, current))
    assert known.holds
    found = pd_pi.design(system, gamma=factor * known.norm_upper)
    assert found.certificate.holds
    assert found.certificate.norm_upper <= factor * known.norm_upper


@pytest.mark.parametrize(("speed", "current"), [(1e3, 1e-3), (1e-9, 1e9), (1e9, 1e-9)])
@pytest.mark.parametrize("solution", ["minimum_norm", "positive"])
def test_feasible_gains_are_found_in_any_units(speed: float, current: float, solution: str) -> None:
    found = pi.design_feasible(motor(speed, current), 1.0, solution=solution)
    assert found.certificate.holds
    assert max(real for real, _ in found.certificate.poles) < -1.0


def two_masses(**changed: Any) -> AugmentedSystem:
    """Two masses on a spring; both positions are measured, one sensor may be wrong."""
    A = np.array(
        [[0.0, 1.0, 0.0, 0.0], [-4.0, -0.4, 4.0, 0.4], [0.0, 0.0, 0.0, 1.0], [2.0, 0.2, -2.0, -0.3]]
    )
    B, C = np.array([[0.0], [1.0], [0.0], [0.0]]), np.eye(4)[[0, 2]]
    given = dict(
        A=A, B=B, C=C, Dd=B, Dw=0.01 * np.eye(2), Fa=B, Fs=np.array([[1.0], [0.0]]), **changed
    )
    return AugmentedSystem(**given)


@pytest.mark.nightly_cases("1.2", "1.1")
@pytest.mark.parametrize("factor", [1.05, 1.1, 1.2, 2.0, 20.0])
def test_design_of_another_plant_works_or_says_what_to_do(factor: float) -> None:
    try:
        found = pd_pi.design(two_masses(), factor=factor)
    except InputError as error:
        assert "a larger factor or gamma, or a faster filter" in str(error)  # noqa: PT017
    else:
        assert found.certificate.holds


# --- Normal forms --------------------------------------------------------------------------------


def van_der_pol(a: float, w: float, y: float) -> PolynomialSystem:
    """Van der Pol's equation with its states and output in other units."""
    a, w, y = float(a), float(w), float(y)
    texts = [f"{a!r} * w / {w!r}", f"{w!r} * (-a / {a!r} + w / {w!r} - (a/{a!r})**2 * w / {w!r})"]
    return PolynomialSystem.from_expressions(texts, [f"{y!r} * a / {a!r}"], ["a", "w"], 3)


@given(POWERS, POWERS, POWERS)
def test_injections_are_those_of_any_units(a: int, w: int, y: int) -> None:
    units = np.array([10.0**a, 10.0**w])
    # l + 1 = -5 and l - (m - 1) = 6 of [l, 1; m - 1, 1]
    expected = np.array([[-6.0], [-11.0]])
    found = injection_for(van_der_pol(*units, 10.0**y), [-2.0, -3.0])
    same_gains(found, expected, units, np.array([10.0**y]))


@given(st.integers(-4, 4), st.integers(-4, 4))
def test_normal_forms_are_those_of_any_units(a: int, w: int) -> None:
    x = np.array([10.0**a, 10.0**w])
    one = normal_form(van_der_pol(1.0, 1.0, 1.0), 3, poles=[-2.0, -3.3])
    other = normal_form(van_der_pol(*x, 10.0**a), 3, poles=[-2.0, -3.3])
    for name in ("S", "T"):
        expected: PolynomialMap = getattr(one, name)
        found: PolynomialMap = getattr(other, name)
        powers = np.prod(x ** np.array(expected.basis.exponents), axis=1)
        back = found.coefficients * powers / x[:, None]
        assert back == pytest.approx(expected.coefficients, rel=AGREE, abs=1e-9)
