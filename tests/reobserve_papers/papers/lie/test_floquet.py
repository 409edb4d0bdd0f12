"""Limit cycles and Floquet exponents known independently."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reobserve.core.errors import InputError
from reobserve.synthesis.normal_form.identity_gain import GAINS, gain_at
from reobserve.systems.polynomial import PolynomialSystem
from reobserve_papers.papers.lie import floquet
from reobserve_papers.papers.lie.floquet import LimitCycle, floquet_exponents, limit_cycle
from tests.reobserve.observers.test_normal_form_observers import exact_gain, form

Array = NDArray[np.float64]

PERIOD = 6.6632868593231  # of Van der Pol's oscillator with mu = 1
L0H = np.array([[-2.0, 0.0], [-4.0, 0.0]])


def system(*dynamics: str) -> PolynomialSystem:
    variables = ["x1", "x2", "x3"][: len(dynamics)]
    return PolynomialSystem.from_expressions(dynamics, ["x1"], variables, 5)


@cache
def van_der_pol_cycle() -> LimitCycle:
    return limit_cycle(form().problem.system, [2.0, 0.5], 60.0)


def slopes(x: Array) -> Array:
    """The Jacobian of Van der Pol's oscillator at points, by hand."""
    found = np.zeros((len(x), 2, 2))
    found[:, 0, 1] = 1.0
    found[:, 1, 0] = -2.0 * x[:, 0] * x[:, 1] - 1.0
    found[:, 1, 1] = 1.0 - x[:, 0] ** 2
    return found


def largest_exponent(kind: str, order: int, count: int = 4000, *, cubic: bool = False) -> float:
    x = van_der_pol_cycle().points(count)
    chosen = form(with_cubic=cubic)
    gain = gain_at(kind, order, chosen.S, chosen.T, chosen.gain, x)
    fed = np.broadcast_to(L0H, (count, 2, 2)).copy()
    if cubic:
        fed[:, :, 0] += x[:, :1] ** 2
    return float(floquet_exponents(van_der_pol_cycle(), slopes(x) + gain @ fed)[0])


def test_limit_cycle_of_van_der_pol_agrees_with_known_values() -> None:
    cycle = van_der_pol_cycle()
    assert cycle.period == pytest.approx(PERIOD, abs=2e-12)
    x = cycle.points(720)
    assert np.max(np.abs(x[:, 0])) == pytest.approx(2.00862, abs=1e-4)
    assert np.mean(x[:, 0] ** 2) == pytest.approx(2.0593769948, abs=1e-9)
    # The mean of (1 - x1^2) is the exponent of the cycle itself, the other one is zero.
    exponents = floquet_exponents(cycle, slopes(cycle.points(8000)))
    np.testing.assert_allclose(exponents, [0.0, 1 - 2.0593769948], atol=1e-9)


def test_sum_of_exponents_agrees_with_liouville_for_constant_gain() -> None:
    """By Liouville it is the mean trace, -2 + 1 - <x1^2>; here both have the same real part."""
    x = van_der_pol_cycle().points(4000)
    exponents = floquet_exponents(van_der_pol_cycle(), slopes(x) + L0H)
    mean = -1.0 - np.mean(x[:, 0] ** 2)
    assert exponents.sum() == pytest.approx(mean, abs=1e-10)
    np.testing.assert_allclose(exponents, mean / 2, atol=1e-10)


@pytest.mark.parametrize(("kind", "order"), [(kind, order) for kind in GAINS for order in (2, 4)])
def test_sum_of_exponents_agrees_with_the_trace_for_any_gain(kind: str, order: int) -> None:
    x = van_der_pol_cycle().points(4000)
    gain = exact_gain(kind, order)
    jacobians = slopes(x) + np.array([gain(point) @ L0H for point in x])
    exponents = floquet_exponents(van_der_pol_cycle(), jacobians)
    mean = np.mean(np.trace(jacobians, axis1=1, axis2=2))
    assert exponents.sum() == pytest.approx(mean, abs=1e-6)
    assert exponents[0] == pytest.approx(largest_exponent(kind, order), abs=1e-11)


def test_exponents_of_the_figure_agree_with_the_cycle() -> None:
    assert largest_exponent("series", 0) == pytest.approx(-1.5296884974, abs=1e-9)
    assert largest_exponent("series", 4) == pytest.approx(-1.0669219076, abs=1e-8)
    assert largest_exponent("series", 2) == pytest.approx(0.19606127, abs=1e-6)
    assert largest_exponent("jacobian", 2, cubic=True) == pytest.approx(-0.5, abs=1e-9)


def test_fundamental_matrix_agrees_with_an_independent_integration() -> None:
    cycle, gain = van_der_pol_cycle(), exact_gain("series", 4)

    def right(_: float, values: Array) -> Any:
        x, E = values[:2], values[2:].reshape(2, 2)
        field = np.array([x[1], (1 - x[0] ** 2) * x[1] - x[0]])
        return np.concatenate([field, ((slopes(x[None])[0] + gain(x) @ L0H) @ E).ravel()])

    start = np.concatenate([cycle.start, np.eye(2).ravel()])
    end = solve_ivp(right, (0, PERIOD), start, method="DOP853", rtol=1e-11, atol=1e-13).y[:, -1]
    np.testing.assert_allclose(end[:2], cycle.start, atol=1e-9)
    multipliers = np.abs(np.linalg.eigvals(end[2:].reshape(2, 2)))
    assert np.log(multipliers.max()) / PERIOD == pytest.approx(
        largest_exponent("series", 4), abs=1e-8
    )


def test_error_is_of_order_four_in_the_number_of_points() -> None:
    counts = np.array([400, 800, 1600])
    exact = largest_exponent("series", 4, 16_000)
    errors = [abs(largest_exponent("series", 4, count) - exact) for count in counts]
    assert np.polyfit(np.log(counts), np.log(errors), 1)[0] == pytest.approx(-4.0, abs=0.4)


def test_exponents_of_constant_matrices_are_their_eigenvalues() -> None:
    cycle = van_der_pol_cycle()
    J = np.array([[-2.0, 1.0, 0.0], [-5.0, 1.0, 0.0], [1.0, 2.0, -0.3]])
    exponents = floquet_exponents(cycle, np.broadcast_to(J, (4000, 3, 3)))
    np.testing.assert_allclose(exponents, [-0.3, -0.5, -0.5], atol=1e-10)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_overflowing_fundamental_matrix_is_refused() -> None:
    cycle = van_der_pol_cycle()
    huge = np.broadcast_to(1e90 * np.eye(2), (4, 2, 2))
    with pytest.raises(InputError, match="the fundamental matrix is not"):
        floquet_exponents(cycle, huge)


@pytest.mark.parametrize("shape", [(3, 2, 2), (4, 2, 3), (0, 2, 2), ()])
def test_jacobians_of_wrong_shape_are_refused(shape: tuple[int, ...]) -> None:
    said = f"jacobians: has shape {shape}, must be (2 m, n, n)"
    with pytest.raises(InputError) as error:
        floquet_exponents(van_der_pol_cycle(), np.ones(shape))
    assert str(error.value) == said


def test_circular_limit_cycle_has_known_exponents() -> None:
    """x' = J x + x (1 - |x|^2) turns once in 2 pi on the unit circle and comes to it as e^-2t."""
    circle = system(
        "x1 + x2 - x1*(x1**2 + x2**2)", "-x1 + x2 - x2*(x1**2 + x2**2)", "-3*x3 + x1**2"
    )
    cycle = limit_cycle(circle, [0.1, 0.0, 0.4], 40.0)
    assert cycle.period == pytest.approx(2 * np.pi, abs=1e-10)
    x = cycle.points(1000)
    np.testing.assert_allclose(np.hypot(x[:, 0], x[:, 1]), 1.0, atol=1e-10)
    jacobians = circle.dynamics.jacobian()(x).reshape(-1, 3, 3)
    np.testing.assert_allclose(floquet_exponents(cycle, jacobians), [0, -2, -3], atol=1e-9)


NO_CYCLE = {
    "a stable origin": (("x2", "-x1 - x2"), [1.0, 0.0], 60.0),
    "a slow spiral": (("x2", "-x1 - 0.01*x2"), [1.0, 0.0], 60.0),
    "the origin itself": (("x2", "(1 - x1**2)*x2 - x1"), [0.0, 0.0], 20.0),
    "an unstable node": (("x1", "x2"), [1.0, 0.0], 20.0),
    "less than one turn": (("x2", "(1 - x1**2)*x2 - x1"), [2.0, 0.5], 3.0),
    "a node elsewhere": (("x1 - x1**3", "-x2"), [0.5, 0.5], 60.0),
    "a spiral elsewhere": (("x2", "x1 - x1**3 - 0.5*x2"), [0.5, 0.5], 60.0),
    "a point on a line": (("x1 - x1**3",), [0.5], 60.0),
}


@pytest.mark.parametrize("case", NO_CYCLE)
def test_system_without_limit_cycle_is_refused(case: str) -> None:
    dynamics, start, settle = NO_CYCLE[case]
    with pytest.raises(InputError, match=r"^initial_state: leads to no limit cycle within"):
        limit_cycle(system(*dynamics), start, settle)


def test_system_escaping_in_finite_time_is_refused() -> None:
    with np.errstate(all="ignore"), pytest.raises(InputError, match="no limit cycle"):
        limit_cycle(system("x1 + x1**3", "-x2"), [1.0, 0.0], 20.0)


def test_initial_state_of_wrong_size_is_refused() -> None:
    with pytest.raises(InputError, match=r"^initial_state: has shape \(3,\), must be a list of 2"):
        limit_cycle(system("x2", "-x1 - x2"), [1.0, 0.0, 0.0], 20.0)


def test_trajectory_with_too_many_slopes_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(floquet, "_MOST_CALLS", 1000)
    with pytest.raises(InputError, match=r"^settle: takes more than 1000 slopes; make it shorter"):
        limit_cycle(system("x2", "(1 - x1**2)*x2 - x1"), [2.0, 0.0], 1e6)
