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
from reobserve.papers.lie.scoring import integral_of_squares
from reobserve.plants.polynomial import PolynomialPlant
from reobserve.synthesis.normal_form.design import NormalForm

Array = NDArray[np.float64]


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

    z is that of the transformed form, S of the full degree; nan if the run diverges.
    """
    from scipy.linalg import expm

    states, output = case.record(form)
    observer = TransformedObserver(form, order, case.sampling_period)
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
            TransformedObserver(form, order, case.sampling_period),
            IdentityObserver(form, order, case.sampling_period, "jacobian"),
        )
    ]
    if any(run.diverged_at is not None for run in runs):
        return float("nan")
    return float(np.max(np.linalg.norm(runs[0]["state"] - runs[1]["state"], axis=1)))


def squared_error(observer: NormalFormObserver, case: Case) -> float:
    """The integral of |x^ - x|^2 over time [s]; nan if the observer diverges."""
    states, output = case.record(observer.normal_form)
    run = _run(observer, output, case)
    if run.diverged_at is not None:
        return float("nan")
    return float(integral_of_squares(run["state"] - states[::2], observer.sampling_period).sum())


def _run(observer: NormalFormObserver, output: Array, case: Case) -> Run[State]:
    start = observer.init(case.initial_estimate)
    return run_on_halves(observer, output, state=start, on_divergence="return")
