"""Sections 2 and 6 on simulations: errors in z, both forms, and decay near the origin."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.normal_form import (
    IdentityObserver,
    NormalFormObserver,
    NormalFormState,
    TransformedObserver,
)
from reobserve.observers.run import Run
from reobserve.polynomials.evaluation_kernels import evaluate, polynomials
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.transform import NormalForm
from reobserve_papers.plants.polynomial import PolynomialPlant

Array = NDArray[np.float64]

GROWTH = 10.0  # of the state, at which it is no longer near the origin
_GROWTHS = (3.0, GROWTH, 100.0)  # other such factors


class Case(NamedTuple):
    """An initial state, an initial estimate, a duration [s] and a sampling period [s]."""

    initial_state: ArrayLike
    initial_estimate: ArrayLike
    duration: float
    sampling_period: float

    def record(self, form: NormalForm) -> tuple[Array, Array]:
        """The plant's states and outputs in half steps."""
        plant = PolynomialPlant(form.problem.system)
        steps = round(self.duration / self.sampling_period)
        states = plant.simulate(self.initial_state, 0.5 * self.sampling_period, 2 * steps)
        return states, plant.output(states)


def deviation_from_linear(form: NormalForm, order: int, case: Case) -> float:
    """Maximum distance of e = z - S(x) from e^(A t) e(0), relative to |e(0)|.

    Thomas, Kwatny & Chang, Remark 2.3.

    z is that of the transformed form, S of the full degree; nan if the run diverges.
    """
    from scipy.linalg import expm

    states, output = case.record(form)
    observer = TransformedObserver(form, order=order, sampling_period=case.sampling_period)
    run = _run(observer, output, case)
    if run.diverged_at is not None:
        return float("nan")
    error = run["coordinates"] - form.S(states[::2])
    transition = expm(form.problem.A * case.sampling_period)
    expected = np.empty_like(error)
    expected[0] = error[0]
    for k in range(1, len(error)):
        expected[k] = transition @ expected[k - 1]
    away = np.linalg.norm(error - expected, axis=1)
    return float(np.max(away) / np.linalg.norm(error[0]))


def difference_of_forms(form: NormalForm, order: int, case: Case) -> float:
    """Maximum distance between the estimates of the transformed and of the identity form.

    The gain of the identity form is the inverse of dS/dx; nan if one of them diverges.
    """
    _, output = case.record(form)
    runs = [
        _run(observer, output, case)
        for observer in (
            TransformedObserver(form, order=order, sampling_period=case.sampling_period),
            IdentityObserver(
                form, order=order, gain="jacobian", sampling_period=case.sampling_period
            ),
        )
    ]
    if any(run.diverged_at is not None for run in runs):
        return float("nan")
    return float(np.max(np.linalg.norm(runs[0]["state"] - runs[1]["state"], axis=1)))


def decay_rate(problem: NormalFormProblem, start: float, duration: float) -> float:
    """The mean slope [1/s] of log |xi| for xi' = gamma(xi, 0), each state from ``start``.

    Thomas, Kwatny & Chang, Definition 2.1.

    gamma(xi, y) = f(xi) + l(h(xi)) - l(y), which satisfies its conditions if A is stable.
    """
    system = problem.system
    f, h, injected = map(_in_floats, (system.dynamics, system.output, problem.injection))

    def slope(_: float, xi: Array) -> Array:
        return f(xi) + injected(h(xi))

    (mean,) = _mean_slopes(slope, np.full(system.states, start), duration, lambda xi: xi).values()
    return mean


def error_decay(
    problem: NormalFormProblem, T: PolynomialMap, start: float, duration: float
) -> dict[float, float]:
    """The mean slope [1/s] of log |T(z) - x| for z' = A z - l(h(x)) from z = 0.

    Thomas, Kwatny & Chang, Proposition 3.10.

    Each state of the plant begins at ``start``. The run ends before ``duration`` if the state
    leaves the neighbourhood of the origin, because the observer is local: if it has grown by a
    factor. The slopes are by that factor.
    """
    system, n = problem.system, problem.system.states
    A = problem.A.astype(np.float64)
    f, h, injected = map(_in_floats, (system.dynamics, system.output, problem.injection))

    def slope(_: float, both: Array) -> Array:
        x, z = both[:n], both[n:]
        return np.concatenate([f(x), A @ z - injected(h(x))])

    first = np.concatenate([np.full(n, start), np.zeros(n)])
    return _mean_slopes(
        slope, first, duration, lambda both: T(both[n:]) - both[:n], n, growths=_GROWTHS
    )


def copy_decay(problem: NormalFormProblem, start: float, duration: float) -> dict[float, float]:
    """The slopes of `error_decay` for a copy of the plant, which starts and stays at the origin."""
    system = problem.system
    first, f = np.full(system.states, start), _in_floats(system.dynamics)
    return _mean_slopes(
        lambda _, x: f(x), first, duration, lambda x: -x, len(first),
        growths=_GROWTHS,
    )  # fmt: skip


def _in_floats(source: PolynomialMap) -> Callable[[Array], Array]:
    """The values of a map at a point of floats, without fractions, which take ten times as long."""
    if not source.exact:
        return source
    terms = polynomials(source)
    monomials = np.empty(len(terms.parent))

    def values(point: Array) -> Array:
        result = np.empty(source.components)
        evaluate(terms, point, monomials, result)
        return result

    return values


def _mean_slopes(
    slope: Callable[[float, Array], Array],
    first: Array,
    duration: float,
    error: Callable[[Array], Array],
    states: int = 0,
    growths: Sequence[float] = (np.inf,),
) -> dict[float, float]:
    """The mean slopes of log |error|, until the first ``states`` have grown by each factor."""
    from scipy.integrate import solve_ivp

    def event(growth: float) -> Callable[[float, Array], float]:
        def near(_: float, values: Array) -> float:
            size = float(np.linalg.norm(values[:states]))
            return size - growth * float(np.linalg.norm(first[:states]))

        near.terminal = growth == max(growths)  # type: ignore[attr-defined]
        return near

    events = [event(growth) for growth in growths] if states else None
    flow = solve_ivp(slope, (0, duration), first, events=events, rtol=1e-10, atol=1e-14)
    before = np.linalg.norm(error(flow.y[:, 0]).astype(np.float64))
    slopes = {}
    for k, growth in enumerate(growths):
        left = bool(states) and len(flow.t_events[k]) > 0
        time, last = (
            (flow.t_events[k][0], flow.y_events[k][0]) if left else (flow.t[-1], flow.y[:, -1])
        )
        after = np.linalg.norm(error(last).astype(np.float64))
        slopes[growth] = float(np.log(after / before) / time)
    return slopes


def _run(observer: NormalFormObserver, output: Array, case: Case) -> Run[NormalFormState]:
    start = observer.init(case.initial_estimate)
    return run_on_halves(observer, output, start=start, on_divergence="return")
