"""What Sections 2 and 3 say of errors, on runs beside a plant."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.normal_form_identity import IdentityObserver
from reobserve.observers.normal_form_observer import NormalFormObserver, State
from reobserve.observers.normal_form_transformed import TransformedObserver
from reobserve.observers.run import Run
from reobserve.plants.polynomial import PolynomialPlant
from reobserve.synthesis.normal_form.design import NormalForm
from reobserve.synthesis.normal_form.problem import NormalFormProblem

Array = NDArray[np.float64]

_NEAR, _WHILE = 0.01, 5.0  # of each state, and for how long [s] its decay is watched


class Case(NamedTuple):
    """From where, from which estimate and for how long [s] an observer runs, in which steps [s]."""

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
    """By how much z - S(x) departs from e^(A t) times its first value, relative to that.

    Thomas, Kwatny & Chang, Remark 2.3.

    z is that of the transformed form, S of the full degree; nan if the run diverges.
    """
    from scipy.linalg import expm

    states, output = case.record(form)
    observer = TransformedObserver(form, order, sampling_period=case.sampling_period)
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
    """The largest distance between the estimates of the transformed and of the identity form.

    The gain of the identity form is the inverse of dS/dx; nan if one of them diverges.
    """
    _, output = case.record(form)
    runs = [
        _run(observer, output, case)
        for observer in (
            TransformedObserver(form, order, sampling_period=case.sampling_period),
            IdentityObserver(form, order, "jacobian", sampling_period=case.sampling_period),
        )
    ]
    if any(run.diverged_at is not None for run in runs):
        return float("nan")
    return float(np.max(np.linalg.norm(runs[0]["state"] - runs[1]["state"], axis=1)))


def decay_rate(problem: NormalFormProblem) -> float:
    """The mean slope [1/s] of log |xi| near the origin for xi' = gamma(xi, 0).

    Thomas, Kwatny & Chang, Definition 2.1.

    gamma(xi, y) = f(xi) + l(h(xi)) - l(y), which satisfies its conditions if A is stable.
    """
    from scipy.integrate import solve_ivp

    system = problem.system

    def slope(_: float, xi: Array) -> Array:
        fed = problem.injection(system.output(xi))
        found: Array = np.asarray(system.dynamics(xi) + fed, dtype=np.float64)
        return found

    start = np.full(system.states, _NEAR)
    flow = solve_ivp(slope, (0, _WHILE), start, rtol=1e-10, atol=1e-14)
    sizes = np.linalg.norm(flow.y[:, [0, -1]], axis=0)
    return float(np.log(sizes[1] / sizes[0])) / _WHILE


def _run(observer: NormalFormObserver, output: Array, case: Case) -> Run[State]:
    start = observer.init(case.initial_estimate)
    return run_on_halves(observer, output, state=start, on_divergence="return")
