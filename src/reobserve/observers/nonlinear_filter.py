"""The base class of the extended and the unscented Kalman filter.

The first row of a record corrects the posterior that `init` was given; before each later row the
filter predicts with the input of the row before, and it corrects with the input of the row itself.
`predict` and `correct` are the two halves, so that such filters can be modes of an `IMM`.

A nan in a row of measurements stands for a number that was not measured, as in
`reobserve.observers.linear_filter`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import DivergenceError
from reobserve.core.matrices import as_row, as_samples, as_vector
from reobserve.core.value import for_loop
from reobserve.observers.contract import Record, Rows
from reobserve.observers.gaussian_filter import (
    Correction,
    Gaussian,
    GaussianFilter,
    KalmanState,
    check_posterior,
    copies,
    inputs_of_rows,
    named,
    new_rows,
)
from reobserve.observers.linear_filter_loop import write_innovation_covariance
from reobserve.observers.nonlinear_filter_loop import correct, predict, run_filter
from reobserve.observers.nonlinear_filter_work import (
    NO_INNOVATION,
    NO_OUTPUT,
    NO_POSTERIOR,
    NO_ROOT,
    NO_STATE,
    new_filter_work,
)
from reobserve.observers.unscented_kalman_loop import Weights
from reobserve.systems.nonlinear import NonlinearModel
from reobserve.systems.nonlinear_flow import Functions

Array = NDArray[np.float64]

CAUSES = {
    NO_STATE: "f, or the covariance after it, is not finite at the next sample",
    NO_OUTPUT: "h is not finite at the next sample",
    NO_INNOVATION: "the covariance of the next innovation is not finite and positive definite",
    NO_ROOT: "the covariance of the state is no longer positive semidefinite, so that it has no "
    "Cholesky factor",
    NO_POSTERIOR: "the next correction is not finite",
}


@dataclass(frozen=True, eq=False, repr=False)
class NonlinearFilter(GaussianFilter):
    """A filter on a nonlinear model; what derives from it says how it moves covariances.

    Its estimates are ``state``, shape (k, n), and ``covariance``, (k, n, n), with ``variance``,
    (k, n), on its diagonal, after each measurement; ``innovation``, (k, m), and
    ``innovation_covariance``, (k, m, m), nan where a measurement is missing; and
    ``log_likelihood``, (k,), of the measurement, zero where all of it is missing.

    Parameters
    ----------
    model
        The model that it trusts, whose sampling period is the filter's.

    Raises
    ------
    InputError
        If it is no nonlinear model.
    """

    model: NonlinearModel

    def __post_init__(self) -> None:
        period = as_kind("model", self.model, NonlinearModel).sampling_period
        object.__setattr__(self, "sampling_period", period)

    @property
    def weights(self) -> Weights | None:
        """Those of sigma points; None of the extended filter."""
        raise NotImplementedError

    @property
    def functions(self) -> Functions:
        """The model as the loop reads it."""
        return self.model.functions

    def predict(self, posterior: Gaussian, u: ArrayLike = ()) -> Gaussian:
        """Time update with the input u of the sample that the posterior is of, shape (p,).

        Raises
        ------
        InputError
            If the input or the posterior has another size, or a Python function returns other
            shapes.
        DivergenceError
            If the result is not finite or the covariance has no root; its time counts from there.
        """
        states, outputs = self._sizes
        posterior = check_posterior("posterior", posterior, len(states), len(outputs))
        mean, covariance = np.empty_like(posterior.mean), np.empty_like(posterior.covariance)
        work = new_filter_work(len(states), len(outputs))
        good = predict(
            states, self.functions, self.weights, for_loop(self.model.Q),
            as_vector("u", u, self.model.inputs), for_loop(posterior.mean),
            for_loop(posterior.covariance), mean, covariance, work,
        )  # fmt: skip
        self.model.raise_problem()
        if not good:
            raise DivergenceError(type(self).__name__, 0.0, CAUSES[int(work.cause[0])])
        return Gaussian(mean, covariance, posterior.error)

    def correct(self, posterior: Gaussian, y: ArrayLike, u: ArrayLike = ()) -> Correction:
        """Measurement update of a predicted posterior; y and u are of the same sample.

        Raises
        ------
        InputError
            If y (nan: missing), u or the posterior has another size, or a Python function returns
            other shapes.
        DivergenceError
            If the covariance of the innovation is not positive definite, or a result is not
            finite; its time counts from there.
        """
        states, outputs = self._sizes
        n, m = len(states), len(outputs)
        taken = as_samples("y", as_row("y", y), m, missing=True)[0]
        control = as_vector("u", u, self.model.inputs)
        posterior = check_posterior("posterior", posterior, n, m)
        innovation, spread = np.full(m, np.nan), np.full((m, m), np.nan)
        if np.isnan(taken).all():
            return Correction(posterior, innovation, spread, 0.0)
        after = copies(posterior)
        factor, work = np.empty((m, m)), new_filter_work(n, m)
        log_likelihood = correct(
            states, outputs, self.functions, self.weights, for_loop(self.model.R), taken, control,
            after[0], after[1], innovation, factor, work,
        )  # fmt: skip
        self.model.raise_problem()
        if np.isnan(log_likelihood):
            raise DivergenceError(type(self).__name__, 0.0, CAUSES[int(work.cause[0])])
        write_innovation_covariance(innovation, factor, spread)
        return Correction(Gaussian(*after), innovation, spread, log_likelihood)

    def _fill(self, state: KalmanState, record: Record) -> Rows:
        return self._filtered(state, record)[0]

    def _finding(self, state: KalmanState, record: Record, good: int, first: float) -> str:
        return CAUSES.get(self._filtered(state, record)[1], "")

    def _filtered(self, state: KalmanState, record: Record) -> tuple[Rows, int]:
        """The rows, and why the loop stopped, a key of `CAUSES`, or 0."""
        states, outputs = self._sizes
        n, m, k = len(states), len(outputs), len(record.y)
        after, fresh = copies(state.posterior), state.sample is None
        rows = new_rows(k, n, m)
        good, cause = run_filter(
            states, outputs, self.functions, self.weights, *self._noise_of_rows(state), record.y,
            inputs_of_rows(state.sample, record), fresh, after[0], after[1], *rows,
            np.empty((m, m)), new_filter_work(n, m),
        )  # fmt: skip
        self.model.raise_problem()
        return Rows(named(rows), good, self._after(state, record, Gaussian(*after))), cause
