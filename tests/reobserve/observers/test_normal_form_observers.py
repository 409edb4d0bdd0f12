"""The observers against an independent integration, and their use in runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from reobserve.core.errors import DivergenceError
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.normal_form import (
    IdentityObserver,
    NormalFormObserver,
    TransformedObserver,
)
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.identity_gain import GAINS
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve.synthesis.normal_form.transform import NormalForm, normal_form
from reobserve.systems.polynomial import PolynomialSystem
from tests.reobserve.synthesis.normal_form.systems import (
    Case,
    Polynomials,
    composed,
    fraction,
    inverted,
    parts,
    to_map,
    to_polynomials,
    van_der_pol,
    variables,
)

Array = NDArray[np.float64]

A = np.array([[-2.0, 1.0], [-5.0, 1.0]])  # F + L0 H of the example, by hand
START, ESTIMATE = np.array([2.0, 0.5]), np.array([0.3, -0.2])


def cubic() -> Case:
    """Van der Pol with the cubic injection for which S = (x1, x2 + x1^3 / 3) is exact."""
    (y,) = variables(1)
    linear = van_der_pol()
    return Case(linear.f, linear.h, [c + y**3 / 3 for c in linear.l])


def as_function(polynomials: Polynomials) -> Callable[[Array], Array]:
    """The values at a point, from the exact coefficients."""
    rows = []
    for p in polynomials:
        powers = np.array([m for m, _ in p.terms()], dtype=int).reshape(-1, p.ring.ngens)
        rows.append((powers, np.array([float(fraction(c)) for _, c in p.terms()])))
    return lambda x: np.array([c @ np.prod(x**m, axis=1) for m, c in rows])


@cache
def exact_series(degree: int) -> tuple[Polynomials, Polynomials]:
    """S by the package over fractions, T as its inverse by independent arithmetic."""
    problem = van_der_pol().problem(degree)
    S = to_polynomials(PolynomialMap(problem.basis, solve_s(problem, solver_for(problem))))
    return S, inverted([p.ring(p) for p in S], degree)


def gradient(polynomials: Polynomials) -> Polynomials:
    return [p.diff(x) for p in polynomials for x in p.ring.gens]


def exact_gain(kind: str, order: int) -> Callable[[Array], Array]:
    """L(x) of an order by its definition, from exact coefficients."""
    S, T = exact_series(order + 1)
    slope_of_s, slope_of_t = as_function(gradient(S)), as_function(gradient(T))
    if kind == "jacobian":
        return lambda x: np.linalg.inv(slope_of_s(x).reshape(2, 2))
    if kind == "composed":
        inner = as_function(S)
        return lambda x: slope_of_t(inner(x)).reshape(2, 2)
    cut_off = [parts(p, 0, order) for p in composed(gradient(T), S, order)]
    series = as_function(cut_off)
    return lambda x: series(x).reshape(2, 2)


def slope(x: Array) -> Array:
    return np.array([x[1], (1 - x[0] ** 2) * x[1] - x[0]])


def injected(y: float, *, with_cubic: bool = False) -> Array:
    return np.array([-2.0, -4.0]) * y + (y**3 / 3 if with_cubic else 0.0)


def integrated(right: Callable[[Array, Array], Array], start: Array, times: Array) -> Array:
    """The plant from (2, 0.5) with an observer with the right-hand side ``right(x, xi)``."""

    def both(_: float, values: Array) -> Array:
        return np.concatenate([slope(values[:2]), right(values[:2], values[2:])])

    first = np.concatenate([START, start])
    solution = solve_ivp(
        both, (0, times[-1]), first, method="DOP853", rtol=1e-12, atol=1e-13, t_eval=times
    )
    assert solution.success
    return np.asarray(solution.y.T)


@cache
def plant(step: float, steps: int) -> Array:
    """States of the plant every half step, from an independent integrator."""
    times = np.arange(2 * steps + 1) * (0.5 * step)
    return integrated(lambda _, xi: 0 * xi, np.zeros(2), times)[:, :2]


@cache
def form(degree: int = 13, *, with_cubic: bool = False, exact: bool = False) -> NormalForm:
    case = cubic() if with_cubic else van_der_pol()
    f, h, l = (to_map(p, exact=exact) for p in (case.f, case.h, case.l))  # noqa: E741
    return normal_form(PolynomialSystem(f, h), degree, injection=l)


def identity_right(kind: str, order: int) -> Callable[[Array, Array], Array]:
    gain = exact_gain(kind, order)
    return lambda x, e: slope(e) + gain(e) @ (injected(e[0]) - injected(x[0]))


ORDERS = [(kind, order) for kind in GAINS for order in (0, 4)]
ORDERS += [("series", 2), ("series", 7), ("jacobian", 7)]


@pytest.mark.parametrize(("kind", "order"), ORDERS)
def test_identity_form_agrees_with_an_independent_integration(kind: str, order: int) -> None:
    step, steps = 1e-3, 3000
    states = integrated(identity_right(kind, order), ESTIMATE, np.arange(steps + 1) * step)
    observer = IdentityObserver(form(), order=order, gain=kind, sampling_period=step)
    run = run_on_halves(observer, plant(step, steps)[:, :1], start=observer.init(ESTIMATE))
    assert run.diverged_at is None
    assert run.end.count == steps
    assert np.max(np.abs(run["state"] - states[:, 2:])) < 1e-9


@pytest.mark.parametrize("with_cubic", [False, True])
def test_transformed_form_agrees_with_an_independent_integration(with_cubic: bool) -> None:
    step, steps = 1e-3, 5000
    chosen = form(5, with_cubic=with_cubic)
    S, T = exact_series(5)
    if with_cubic:
        z1, z2 = variables(2)
        S, T = [z1, z2 + z1**3 / 3], [z1, z2 - z1**3 / 3]
    start = as_function(S)(ESTIMATE)
    z = integrated(
        lambda x, z: A @ z - injected(x[0], with_cubic=with_cubic),
        start,
        np.arange(steps + 1) * step,
    )[:, 2:]
    observer = TransformedObserver(chosen, order=4, sampling_period=step)
    run = run_on_halves(observer, plant(step, steps)[:, :1], start=observer.init(ESTIMATE))
    assert np.max(np.abs(run["coordinates"] - z)) < 1e-9
    read = as_function(T)
    wanted = np.array([read(row) for row in z])
    assert np.max(np.abs(run["state"] - wanted) / (1 + np.abs(wanted))) < 1e-9


def built(name: str, step: float, *, with_cubic: bool = False) -> NormalFormObserver:
    chosen = form(with_cubic=with_cubic)
    if name == "transformed":
        return TransformedObserver(chosen, order=4, sampling_period=step)
    return IdentityObserver(chosen, order=4, gain=name, sampling_period=step)


@pytest.mark.parametrize("name", [*GAINS, "transformed"])
def test_error_is_of_order_four_in_the_step(name: str) -> None:
    steps = [100, 200, 400]
    ends = {}
    for count in [*steps, 6400]:
        step = 4.0 / count
        observer = built(name, step)
        run = run_on_halves(observer, plant(step, count)[:, :1], start=observer.init(ESTIMATE))
        ends[count] = run["state"][-1]
    errors = [np.linalg.norm(ends[count] - ends[6400]) for count in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(-4.0, abs=0.25)


@pytest.mark.parametrize("power", [0, 1, 2])
def test_transformed_form_is_exact_for_a_parabola(power: int) -> None:
    """z' = A z - L0 t^power, with a step far beyond the reach of an integrator."""
    step, steps = 0.7, 9
    chain = np.zeros((2 + power + 1, 2 + power + 1))  # z and t^power, ..., t, 1
    chain[:2, :2], chain[:2, 2] = A, [2.0, 4.0]  # A and -L0
    for k in range(power):
        chain[2 + k, 3 + k] = power - k
    start = np.concatenate([ESTIMATE, np.zeros(power), [1.0]])
    observer = TransformedObserver(form(1), order=0, sampling_period=step)
    y = (np.arange(2 * steps + 1) * 0.5 * step) ** power
    run = run_on_halves(observer, y, start=observer.init(ESTIMATE))
    wanted = np.array([(expm(chain * k * step) @ start)[:2] for k in range(steps + 1)])
    np.testing.assert_allclose(run["state"], wanted, rtol=1e-12, atol=1e-12)


def test_order_zero_gives_the_constant_gain_in_every_form() -> None:
    y = plant(0.01, 300)[:, :1]
    observers = [
        IdentityObserver(form(), order=0, gain=kind, sampling_period=0.01) for kind in GAINS
    ]
    runs = [run_on_halves(o, y, start=o.init(ESTIMATE))["state"] for o in observers]
    assert len({rows.tobytes() for rows in runs}) == 1


def test_both_forms_agree_under_exact_linearisation() -> None:
    step, steps = 2e-3, 5000
    y = plant(step, steps)[:, :1]
    observers = [built(name, step, with_cubic=True) for name in ("jacobian", "transformed")]
    one, other = (run_on_halves(o, y, start=o.init(ESTIMATE))["state"] for o in observers)
    assert np.max(np.abs(one - other)) < 1e-9


def test_error_is_exactly_linear_in_z() -> None:
    step, steps = 1e-3, 20_000
    x = plant(step, steps)
    z = np.stack([x[:, 0], x[:, 1] + x[:, 0] ** 3 / 3], axis=1)[::2]
    observer = TransformedObserver(form(3, with_cubic=True), order=2, sampling_period=step)
    run = run_on_halves(observer, x[:, :1], start=observer.init(ESTIMATE))
    error = run["coordinates"] - z
    every = range(0, steps + 1, 250)
    wanted = [expm(A * k * step) @ error[0] for k in every]
    assert np.max(np.abs(error[list(every)] - wanted)) < 1e-10


def test_divergence_is_reported_with_time_and_last_state() -> None:
    """Order 2 diverges at about 9.736 s; an integrator with error control agrees."""
    step, steps = 2e-3, 10_000
    y = plant(step, steps)[:, :1]
    observer = IdentityObserver(form(), order=2, sampling_period=step)
    start = observer.init([0.0, 0.0])
    run = run_on_halves(observer, y, start=start, on_divergence="return")
    assert run.diverged_at == pytest.approx(9.736, abs=0.01)
    assert len(run) == round(run.diverged_at / step) + 1
    assert np.isfinite(run["state"]).all()
    assert run.end is start
    right = identity_right("series", 2)
    escape = solve_ivp(
        lambda _, v: np.concatenate([slope(v[:2]), right(v[:2], v[2:])]),
        (0, 20), [*START, 0, 0], method="DOP853", rtol=1e-10, atol=1e-10,
        events=_far, max_step=0.1,
    )  # fmt: skip
    assert escape.t_events[0][0] == pytest.approx(run.diverged_at, abs=0.02)
    half = 2 * (len(run) // 2)
    before = run_on_halves(observer, y[: half + 1], start=start)
    assert before.diverged_at is None
    after = run_on_halves(observer, y[half + 1 :], start=before.end, on_divergence="return")
    assert after.diverged_at == pytest.approx(run.diverged_at)
    last = 2 * len(run) - 1
    state = run_on_halves(observer, y[:last], start=start).end
    with pytest.raises(DivergenceError, match=rf"up to t = {run.diverged_at:g} s and not after"):
        observer.step(state, y[last + 1], middle=(y[last], None))


def _far(_: float, values: Array) -> float:
    return 1e4 - float(np.max(np.abs(values[2:])))


_far.terminal = True  # type: ignore[attr-defined]


def test_overflow_of_the_first_estimate_is_reported() -> None:
    """z is finite, T(z) is not: no row is returned, and the state is the initial one."""
    observer = TransformedObserver(form(5), order=4, sampling_period=0.1)
    start = replace(observer.init([0.0, 0.0]), values=np.array([1e100, 1e100]))
    run = observer.run(np.zeros((3, 1)), start=start, on_divergence="return")
    assert run.diverged_at == 0.0
    assert run["state"].shape == (0, 2)
    assert run.end is start


@pytest.mark.parametrize("name", ["series", "transformed"])
def test_run_without_a_state_starts_from_the_origin(name: str) -> None:
    observer, y = built(name, 0.01), plant(0.01, 30)[::2, :1]
    known = observer.run(y, start=observer.init([0.0, 0.0]))
    assert np.array_equal(observer.run(y)["state"], known["state"])


@pytest.mark.parametrize("kind", NormalFormObserver.__subclasses__())
def test_series_of_fractions_run_like_floats(kind: Any) -> None:
    y = plant(0.01, 300)[:, :1]
    floats, fractions = (
        kind(form(5, exact=exact), order=4, sampling_period=0.01) for exact in (False, True)
    )
    one, other = (run_on_halves(o, y, start=o.init(ESTIMATE))["state"] for o in (floats, fractions))
    np.testing.assert_allclose(np.asarray(other, dtype=np.float64), one, rtol=0, atol=1e-12)
