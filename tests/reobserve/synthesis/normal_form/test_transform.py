"""From a user-defined system to its observer; checks of poles and eigenvalues on the way."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest
import sympy
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from reobserve.core.errors import InputError
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.normal_form import (
    IdentityObserver,
    NormalFormObserver,
    TransformedObserver,
    normal_form_observer,
)
from reobserve.polynomials.maps import PolynomialMap
from reobserve.polynomials.monomials import monomials
from reobserve.synthesis.normal_form.identity_gain import GAINS, gain_at
from reobserve.synthesis.normal_form.placement import injection_for
from reobserve.synthesis.normal_form.resonance import resonance
from reobserve.synthesis.normal_form.transform import NormalForm, normal_form
from reobserve.systems.polynomial import PolynomialSystem
from tests.reobserve.synthesis.normal_form.systems import (
    to_map,
    van_der_pol,
)

Array = NDArray[np.float64]

PENDULUM = (["x2", "-sin(x1) - 0.2*x2"], ["x1"], ["x1", "x2"])
DUFFING = (["x2", "-x1 - x1**3/2 - x2/5"], ["x1 + x1**2/10"], ["x1", "x2"])
TWO_OUTPUTS = (
    ["x2 + x1*x3/4", "-x1 - x2/5 + x3**2/3", "-x3/2 + x1*x2/4"], ["x1", "x3 + x2**2/5"],
    ["x1", "x2", "x3"],
)  # fmt: skip
SYSTEMS: dict[str, tuple[Any, list[complex], list[float]]] = {
    "pendulum": (PENDULUM, [-1.5 + 1j, -1.5 - 1j], [0.5, -0.2]),
    "duffing": (DUFFING, [-1.2, -2.1], [0.4, 0.1]),
    "two outputs": (TWO_OUTPUTS, [-1.3, -2.1 + 0.5j, -2.1 - 0.5j], [0.3, -0.3, 0.4]),
}


def simulated(described: Any, start: list[float], times: Array) -> tuple[Array, Array]:
    """States and outputs of the expressions themselves, including sines."""
    dynamics, output, names = described
    f, h = (
        sympy.lambdify([sympy.symbols(names)], [sympy.sympify(e) for e in part])
        for part in (dynamics, output)
    )
    solution = solve_ivp(lambda _, x: f(x), (0, times[-1]), start, method="DOP853", t_eval=times,
                         rtol=1e-11, atol=1e-12)  # fmt: skip
    return solution.y.T, np.array([h(x) for x in solution.y.T])


@pytest.mark.parametrize("form", ["identity", "transformed"])
@pytest.mark.parametrize("name", SYSTEMS)
def test_one_call_designs_an_observer_for_a_user_defined_system(name: str, form: str) -> None:
    described, poles, start = SYSTEMS[name]
    step, steps = 0.02, 800
    x, y = simulated(described, start, np.arange(2 * steps + 1) * step / 2)
    observer = normal_form_observer(
        *described, order=6, sampling_period=step, poles=poles, form=form
    )
    reached = np.linalg.eigvals(np.asarray(observer.normal_form.problem.A))
    np.testing.assert_allclose(np.poly(reached), np.poly(poles), atol=1e-9)
    run = run_on_halves(observer, y, start=observer.init([0.0] * len(start)))
    error = np.linalg.norm(run["state"] - x[::2], axis=1)
    assert run.diverged_at is None
    # The rest is the error of the integrator and of the truncated T.
    assert error[-1] < (1e-6 if form == "identity" else 1e-3) * error[0]
    listed, framed = observer.run(y.tolist()), observer.run(pd.DataFrame(y))
    assert listed["state"].tobytes() == framed["state"].tobytes()


@pytest.mark.parametrize("gain", GAINS)
def test_one_call_agrees_with_the_stepwise_construction(gain: str) -> None:
    _, y = simulated(DUFFING, [0.4, 0.1], np.arange(201) * 0.01)
    system = PolynomialSystem.from_expressions(*DUFFING, 9)
    injection = injection_for(system, [-1.2, -2.1])
    series = normal_form(system, 5, injection=PolynomialMap.linear(injection))
    by_hand: list[NormalFormObserver] = [
        IdentityObserver(series, order=4, gain=gain, sampling_period=0.02),
        TransformedObserver(series, order=4, sampling_period=0.02),
    ]
    for form, other in zip(("identity", "transformed"), by_hand, strict=True):
        how: dict[str, Any] = {"order": 4, "sampling_period": 0.02, "form": form, "gain": gain}
        for given in ({"poles": [-1.2, -2.1]}, {"injection": injection}):
            one = normal_form_observer(*DUFFING, **how, **given)
            left, right = (o.run(y, start=o.init([0.1, 0.0])) for o in (one, other))
            assert left["state"].tobytes() == right["state"].tobytes()
            assert left.end.values.tobytes() == right.end.values.tobytes()


def test_sympy_symbols_and_text_are_equivalent() -> None:
    angle, rate = sympy.symbols("angle rate", real=True)
    one = normal_form_observer([rate, -sympy.sin(angle) - rate / 5], [angle], [angle, rate],
                               order=4, sampling_period=0.1, poles=[-1, -1.7])  # fmt: skip
    other = normal_form_observer(*PENDULUM, order=4, sampling_period=0.1, poles=[-1, -1.7])
    np.testing.assert_allclose(
        one.normal_form.gain.coefficients, other.normal_form.gain.coefficients, rtol=1e-14
    )


def test_non_polynomials_are_expanded_to_degree_nine_by_default() -> None:
    for more, degree in (({}, 9), ({"expanded": 5}, 5), ({"expanded": 5, "degree": 13}, 13)):
        observer = normal_form_observer(["sin(x) + x**10 + x**14"], ["x"], ["x"], order=4,
                                        sampling_period=0.1, poles=[-0.5], **more)  # fmt: skip
        _, powers, last = list(observer.normal_form.problem.system.dynamics.terms())[-1]
        assert powers == (degree,)
        assert last == pytest.approx(1.0 / math.factorial(degree), rel=1e-14)


def test_domain_can_be_checked_after_one_call() -> None:
    """The series of f go up to degree 25, enough for the radius, though the gain is of order 4."""
    observer = normal_form_observer(["x - x**2"], ["x"], ["x"], order=4, sampling_period=0.1,
                                    poles=[-0.5], degree=25)  # fmt: skip
    run = observer.run(np.full((41, 1), 0.5), start=observer.init([0.5]))
    assert observer.check_domain(run) is None


# -- gain


def example() -> NormalForm:
    f, h, l = (to_map(p, exact=False) for p in (van_der_pol().f, van_der_pol().h, van_der_pol().l))  # noqa: E741
    return normal_form(PolynomialSystem(f, h), 9, injection=l)


@pytest.mark.parametrize("order", [0, 4, 8])
@pytest.mark.parametrize("gain", GAINS)
def test_gain_agrees_with_finite_differences(gain: str, order: int) -> None:
    form, draw = example(), np.random.default_rng(2)
    x = 0.5 * draw.normal(size=(6, 2))
    found = gain_at(gain, order, form.S, form.T, form.gain, x)
    assert found.shape == (6, 2, 2)

    def slope(of: Callable[[Array], Array], at: Array) -> Array:
        h = 1e-3 * np.eye(2)
        columns = [
            (8 * (of(at + d) - of(at - d)) - (of(at + 2 * d) - of(at - 2 * d))) / 12e-3 for d in h
        ]
        return np.stack(columns, axis=-1)

    S, T = form.S.upto(order + 1), form.T.upto(order + 1)
    if gain == "series":  # by its values: the remainder beyond the order falls as its next term
        near = 1e-2 * x
        short = gain_at(gain, order, form.S, form.T, form.gain, near)
        full = np.linalg.inv(slope(form.S, near))
        bound = 1e-9 if order else 1e-2
        assert np.max(np.abs(short - full)) < bound
        return
    wanted = np.linalg.inv(slope(S, x)) if gain == "jacobian" else slope(T, S(x))
    np.testing.assert_allclose(found, wanted, rtol=1e-8, atol=1e-8)


def test_unknown_gain_variant_is_refused() -> None:
    form = example()
    with pytest.raises(InputError, match="'jacobain' must be one of series, jacobian, composed"):
        gain_at("jacobain", 4, form.S, form.T, form.gain, np.zeros((1, 2)))


# -- resonance


def test_smallest_divisor_of_the_example_agrees_with_hand_calculation() -> None:
    """m.alpha of degree 2 is 1 +- sqrt(3) i or 1, lambda is (-1 +- sqrt(11) i) / 2."""
    found = example().resonance
    assert found is not None
    assert found.distance == pytest.approx(np.hypot(1.5, np.sqrt(3) - np.sqrt(11) / 2), rel=1e-12)
    assert found.distance == pytest.approx(1.5018, abs=1e-4)
    assert sorted(found.powers) == [0, 2]
    assert found.eigenvalue.real == pytest.approx(-0.5)
    assert abs(found.eigenvalue.imag) == pytest.approx(np.sqrt(11) / 2)
    assert found.size == pytest.approx(2.0)


def test_resonance_agrees_with_a_brute_force_search() -> None:
    F, A = np.diag([-1.0, -2.6]), np.diag([-4.3, -9.1])
    found = resonance(F, A, monomials(2, 6))
    assert (found.powers, found.eigenvalue) == ((4, 2), -9.1 + 0j)
    assert found.distance == pytest.approx(0.1)
    assert resonance(F, A, monomials(2, 3)).powers == (2, 1)


REVERSED = (["-x2", "-(1 - x1**2)*x2 + x1"], ["x1"], ["x1", "x2"])


def test_resonant_poles_are_refused_with_m_and_lambda() -> None:
    """alpha = (-1 +- sqrt(3) i) / 2, whose sum is -1: -2 is 2 alpha1 + 2 alpha2."""
    with pytest.raises(InputError) as caught:
        normal_form_observer(*REVERSED, order=3, sampling_period=0.1, poles=[-2, -3.5])
    said = str(caught.value)
    for part in ("the eigenvalue -2", "m = (2, 2)", "alpha = -0.5+0.866025j, -0.5-0.866025j",
                 "a degree below 4"):  # fmt: skip
        assert part in said
    below = normal_form_observer(*REVERSED, order=2, sampling_period=0.1, poles=[-2, -3.5])
    assert below.normal_form.S.degree == 3


# -- placement


def test_placement_with_one_output_agrees_with_ackermann() -> None:
    described = (
        ["x2 + x1**2", "2*x1 - x2 + x3", "x1*x2 - 3*x3 + x1"],
        ["x1 + x3"],
        ["x1", "x2", "x3"],
    )
    system = PolynomialSystem.from_expressions(*described, 2)
    poles = [-2.0, -1.5 + 2j, -1.5 - 2j]
    F, H = np.array([[0, 1, 0], [2, -1, 1], [1, 0, -3.0]]), np.array([[1, 0, 1.0]])
    seen = np.concatenate([H, H @ F, H @ F @ F])
    polynomial = sum(
        c * np.linalg.matrix_power(F, 3 - k) for k, c in enumerate(np.poly(poles).real)
    )
    wanted = -polynomial @ np.linalg.solve(seen, np.array([0, 0, 1.0]))
    np.testing.assert_allclose(injection_for(system, poles)[:, 0], wanted, rtol=1e-9)


@pytest.mark.parametrize("poles", [[-1, -2, -3], [-1, -1, -2], [-1 + 3j, -1 - 3j, -5]])
def test_placement_with_two_outputs_gives_the_poles(poles: list[complex]) -> None:
    system = PolynomialSystem.from_expressions(*TWO_OUTPUTS, 2)
    A = system.F + injection_for(system, poles) @ system.H
    np.testing.assert_allclose(np.poly(A), np.poly(poles), rtol=1e-6, atol=1e-6)


def test_redundant_outputs_are_accepted() -> None:
    """Two sensors of the same quantity are not refused."""
    system = PolynomialSystem.from_expressions(["x2", "-x1"], ["x1", "2*x1"], ["x1", "x2"], 2)
    A = system.F + injection_for(system, [-1, -2]) @ system.H
    np.testing.assert_allclose(np.poly(A), [1, 3, 2], atol=1e-9)


def test_stable_unobservable_modes_are_allowed() -> None:
    described = (["x2", "-x1 - x2", "-3*x3 + x1**2"], ["x1"], ["x1", "x2", "x3"])
    system = PolynomialSystem.from_expressions(*described, 2)
    A = system.F + injection_for(system, [-1.3, -2.2, -3.0]) @ system.H
    np.testing.assert_allclose(np.sort(np.linalg.eigvals(A)), [-3.0, -2.2, -1.3], rtol=1e-9)
    with pytest.raises(InputError, match=r"^poles: .*-3\b.* remain.*not observable"):
        injection_for(system, [-1.3, -2.2, -4.1])
