"""What Sections 2 and 3 say of errors, on runs beside a plant."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.observers.normal_form_identity import IdentityObserver
from reobserve.observers.normal_form_observer import NormalFormObserver
from reobserve.observers.normal_form_transformed import TransformedObserver
from reobserve.papers.lie.scoring import integral_of_squares
from reobserve.plants.polynomial import PolynomialPlant
from reobserve.synthesis.normal_form.design import NormalForm

Array = NDArray[np.float64]


class Case(NamedTuple):
    """From where, from which estimate and for how long [s] an observer runs, in which steps [s]."""

    initial_state: ArrayLike
    initial_estimate: ArrayLike
    duration: float
    step_size: float

    def record(self, form: NormalForm) -> tuple[Array, Array]:
        """The plant's states and outputs in half steps."""
        plant = PolynomialPlant(form.problem.system)
        steps = round(self.duration / self.step_size)
        states = plant.simulate(self.initial_state, 0.5 * self.step_size, 2 * steps)
        return states, plant.output(states)


def deviation_from_linear(form: NormalForm, order: int, case: Case) -> float:
    """By how much z - S(x) departs from e^(A t) times its first value, relative to that.

    z is that of the transformed form, S of the full degree; nan if the run diverges.
    """
    from scipy.linalg import expm

    states, output = case.record(form)
    observer = TransformedObserver(form, order, case.step_size)
    run = observer.run(output, observer.init(case.initial_estimate), on_divergence="return")
    if run.diverged_at is not None or run.coordinates is None:
        return float("nan")
    error = run.coordinates - form.S(states[::2])
    transition = expm(form.problem.A * case.step_size)
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
        observer.run(output, observer.init(case.initial_estimate), on_divergence="return")
        for observer in (
            TransformedObserver(form, order, case.step_size),
            IdentityObserver(form, order, case.step_size, "jacobian"),
        )
    ]
    if any(run.diverged_at is not None for run in runs):
        return float("nan")
    return float(np.max(np.linalg.norm(runs[0].estimate - runs[1].estimate, axis=1)))


def squared_error(observer: NormalFormObserver, case: Case) -> float:
    """The integral of |x^ - x|^2 over time [s]; nan if the observer diverges."""
    states, output = case.record(observer.normal_form)
    run = observer.run(output, observer.init(case.initial_estimate), on_divergence="return")
    if run.diverged_at is not None:
        return float("nan")
    return float(integral_of_squares(run.estimate - states[::2], observer.step_size).sum())
