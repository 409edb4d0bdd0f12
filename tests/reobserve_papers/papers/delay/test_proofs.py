"""Proofs of the paper about delay and input: observability, the remainder, and errata."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
import sympy
from numpy.typing import NDArray

from reobserve_papers.signals.inputs import Signal
from tests.reobserve_papers.plants.test_delayed_plants import PROFILE, RAMP, SINE

Array = NDArray[np.float64]

FREQUENCY, LARGEST_DELAY = 0.2, 1.5


# --- The remainder (6) and its bound (7) --------------------------------------------------------


def remainder(control: Signal, order: int, time: Array, delay: float) -> Array:
    """gamma_m(t, -tau) = u(t - tau) - sum over i = 0..m of (-tau)^i / i! u^(i)(t)."""
    value = control(time - delay)[:, 0]
    factor = 1.0
    for i in range(order + 1):
        value = value - factor * control(time)[:, 0]
        control = control.derivative("control")
        factor *= -delay / (i + 1)
    return value


def bound(order: int, delay: float, largest: float) -> float:
    """The right-hand side of (7): tau^(m+1) / (m+1)! U_(m+1)."""
    return delay ** (order + 1) / float(sympy.factorial(order + 1)) * largest


@pytest.mark.parametrize("order", [1, 2, 3])
def test_remainder_stays_within_its_bound(order: int) -> None:
    time = np.linspace(0, 120, 6001)
    for delay in np.linspace(0.05, LARGEST_DELAY, 30):
        gamma = np.abs(remainder(SINE, order, time, delay))
        # Differences of numbers of order one have an error of 1e-16, whatever the bound.
        assert np.max(gamma) <= bound(order, delay, FREQUENCY ** (order + 1)) + 1e-15


@pytest.mark.parametrize(("order", "printed"), [(1, 0.045), (2, 0.0045), (3, 0.0003375)])
def test_bound_for_the_largest_delay_is_nearly_attained(order: int, printed: float) -> None:
    """The remainder of a sine is a sine of amplitude |exp(-i w tau) - its Taylor polynomial|."""
    limit = bound(order, LARGEST_DELAY, FREQUENCY ** (order + 1))
    assert limit == pytest.approx(printed)
    turn = -1j * FREQUENCY * LARGEST_DELAY
    polynomial = sum(turn**i / float(sympy.factorial(i)) for i in range(order + 1))
    amplitude = abs(np.exp(turn) - polynomial)
    time = np.linspace(0, 10 * np.pi, 20001)
    largest = np.max(np.abs(remainder(SINE, order, time, LARGEST_DELAY)))
    assert largest == pytest.approx(amplitude, rel=1e-6)
    assert 0.995 < largest / limit < 1


@pytest.mark.parametrize("order", [1, 2, 3])
def test_bound_is_attained_as_the_delay_tends_to_zero(order: int) -> None:
    """At the instants at which |u^(m+1)| is largest, with 50 digits against cancellation."""
    with mpmath.workdps(50):
        w = mpmath.mpf(FREQUENCY)
        instant = (mpmath.pi / 2 if order % 2 else mpmath.pi) / w
        gaps = []
        for delay in (mpmath.mpf(1), mpmath.mpf("0.1"), mpmath.mpf("0.01")):
            taylor = sum(
                (-delay) ** i / mpmath.factorial(i) * mpmath.diff(mpmath.sin, w * instant, i) * w**i
                for i in range(order + 1)
            )
            gamma = abs(mpmath.sin(w * (instant - delay)) - taylor)
            gaps.append(1 - gamma * mpmath.factorial(order + 1) / (w * delay) ** (order + 1))
        assert all(gap > 0 for gap in gaps)
        # An even derivative peaks in the middle of a parabola: the gap falls as tau^2.
        assert gaps[2] < 1e-6
        assert gaps[0] / gaps[1] == pytest.approx(100, rel=0.01)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_power_attains_the_bound_exactly(order: int) -> None:
    """Of u = t^(m+1) the remainder is (-tau)^(m+1), and U_(m+1) = (m+1)!."""
    t, tau = sympy.symbols("t tau", positive=True)
    u = t ** (order + 1)
    taylor = sum((-tau) ** i / sympy.factorial(i) * u.diff(t, i) for i in range(order + 1))
    gamma = sympy.expand(u.subs(t, t - tau) - taylor)
    largest = u.diff(t, order + 1)
    assert gamma == (-tau) ** (order + 1)
    assert tau ** (order + 1) / sympy.factorial(order + 1) * largest == tau ** (order + 1)


def test_ramp_has_no_remainder() -> None:
    time = np.linspace(0, 120, 1201)
    for order in (1, 2, 3):
        assert np.max(np.abs(remainder(RAMP, order, time, LARGEST_DELAY))) < 1e-15


# --- Observability (Theorem 1) ------------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 3])
def test_determinant_of_the_observability_jacobian_agrees_with_theorem_1(n: int) -> None:
    """It is -G(y) u'(t - tau) for every lower-triangular f and any motion of the delay.

    Time enters through u only: y to y^(n-1) do not depend on the input, so u is differentiated by
    the delay and never by time, and the unknown rate of the delay does not appear.
    """
    t, tau = sympy.symbols("t tau")
    x = sympy.symbols(f"x1:{n + 1}")
    u, G = sympy.Function("u"), sympy.Function("G")
    f = [sympy.Function(f"f{i + 1}")(*x[: i + 1]) for i in range(n)]
    rates = [(x[i + 1] if i + 1 < n else G(x[0]) * u(t - tau)) + f[i] for i in range(n)]
    outputs = [x[0]]
    for _ in range(n):
        assert not outputs[-1].has(u)
        outputs.append(sum(outputs[-1].diff(x[i]) * rates[i] for i in range(n)))
    jacobian = sympy.Matrix(outputs).jacobian([*x, tau])
    for j in range(1, n):  # y^(j) = x_(j+1) + a function of x1 to xj, j = 1 included
        assert sympy.simplify(jacobian[j, j]) == 1
    for row in range(n + 1):
        for column in range(row + 1, n + 1):
            assert sympy.simplify(jacobian[row, column]) == 0
    s = sympy.Symbol("s")
    slope = sympy.Subs(u(s).diff(s), s, t - tau)
    assert sympy.simplify((jacobian.det() + G(x[0]) * slope).doit()) == 0
    # A closed form gives the same without formal derivatives.
    assert jacobian.det().subs(u, sympy.Lambda(s, sympy.sin(s / 5))).doit().equals(
        -G(x[0]) * sympy.cos((t - tau) / 5) / 5
    )  # fmt: skip


@pytest.mark.parametrize("n", [1, 2])
def test_one_more_derivative_makes_the_delay_observable_at_turning_points(n: int) -> None:
    """Theorem 1 is only sufficient: with y to y^(n+1) the rank is full at u' = 0, u'' != 0, tau' !=
    1.
    """
    rate, *u = sympy.symbols("eta u0 u1 u2 u3")
    x = sympy.symbols(f"x1:{n + 1}")
    last = -sympy.sin(x[0]) - sum(x[1:])
    drift = [*x[1:], last + u[0]]
    outputs = [x[0]]
    for _ in range(n + 1):  # t - tau moves with 1 - tau'
        y = outputs[-1]
        moved = sum(y.diff(a) * b for a, b in zip(x, drift, strict=True))
        outputs.append(moved + (1 - rate) * sum(y.diff(u[i]) * u[i + 1] for i in range(3)))
    by_delay = [-sum(y.diff(u[i]) * u[i + 1] for i in range(3)) for y in outputs]
    jacobian = sympy.Matrix(outputs).jacobian(list(x)).row_join(sympy.Matrix(by_delay))
    turning = jacobian.subs({u[1]: 0})
    assert turning[: n + 1, :].det() == 0  # the part considered in the proof
    others = turning.extract([*range(n), n + 1], list(range(n + 1)))
    assert sympy.simplify(others.det() + (1 - rate) * u[2]) == 0


# --- Errata -------------------------------------------------------------------------------------


def test_singular_instants_of_the_sine_differ_from_the_printed_ones() -> None:
    """The condition u' = 0 gives 0.2 t = pi/2 [pi]; printed is 0.15 t = pi/2 [2 pi]."""
    slope = SINE.derivative("control")
    singular = np.pi / 2 / 0.2 + np.pi / 0.2 * np.arange(8)
    assert singular[:2] == pytest.approx([7.854, 23.562], abs=1e-3)
    assert singular[-1] < 120 < singular[-1] + np.pi / 0.2
    assert np.max(np.abs(slope(singular))) < 1e-15
    # These are all: u' has one sign in between and changes it at each.
    between = np.concatenate([[0.0], (singular[:-1] + singular[1:]) / 2, [120.0]])
    assert np.all(np.diff(np.sign(slope(between)[:, 0])) != 0)
    printed = np.pi / 2 / 0.15 + 2 * np.pi / 0.15 * np.arange(3)
    assert printed == pytest.approx([10.472, 52.360, 94.248], abs=1e-3)
    assert slope(printed)[:, 0] == pytest.approx([-0.1, -0.1, 0.2], abs=1e-15)
    # Nor is the frequency or the period alone correct.
    assert abs(slope(np.array([np.pi / 2 / 0.15]))[0, 0]) > 0.09
    other_half = np.array([3 * np.pi / 2 / 0.2])
    assert slope(other_half)[0, 0] == pytest.approx(0, abs=1e-15)


def test_delay_violates_the_continuity_of_assumption_3() -> None:
    at = np.array([20.0, 40.0, 60.0])
    left, right = PROFILE(at, before=True)[:, 0], PROFILE(at)[:, 0]
    assert left.tolist() == [0.6, 1.2, 0.3]
    assert right == pytest.approx([1.2, 0.3, 0.5585], abs=5e-5)
    assert PROFILE.jumps == (20.0, 40.0, 60.0)


def test_delay_of_the_last_minute_satisfies_assumption_3() -> None:
    time = np.linspace(60, 120, 60001)
    delay, rate = PROFILE(time)[:, 0], PROFILE.derivative("delay")(time)[:, 0]
    assert np.min(delay) == pytest.approx(0.35, abs=1e-6)
    assert np.max(delay) == pytest.approx(1.25, abs=1e-6)
    assert np.max(np.abs(rate)) == pytest.approx(0.09, abs=1e-6)
    assert np.max(PROFILE(np.linspace(0, 120, 12001))) <= LARGEST_DELAY
