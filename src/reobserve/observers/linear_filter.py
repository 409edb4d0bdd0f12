"""Filters that correct a linear prediction by a gain: the Kalman filter, the SVSF, fixed gains.

A filter has a `LinearModel` and a gain function. What it holds to be true is a `Gaussian`. The
first row of a record corrects the one that `init` was given; before each later row the filter
predicts with the input of the row before, and corrects with that of the row itself. `predict` and
`correct` are the two halves, which a bank of filters calls one by one.

A nan in a row of measurements stands for a number that was not measured: its innovation is nan, and
the run counts such rows. The other numbers of the row correct as if they alone were measured; over
a row of nothing but nan the filter predicts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import DivergenceError
from reobserve.core.kernel import FunctionPointer
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
from reobserve.observers.linear_filter_loop import (
    correct,
    is_missing,
    new_work,
    predict,
    run_filter,
    write_innovation_covariance,
)
from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class LinearFilter(GaussianFilter):
    """A filter on a linear model; what derives from it says what its gain is.

    Its estimates are those of `reobserve.observers.gaussian_filter.GaussianFilter`.

    Parameters
    ----------
    model
        The linear model that it trusts, whose sampling period is the filter's.

    Raises
    ------
    InputError
        If it is no linear model.
    """

    model: LinearModel

    def __post_init__(self) -> None:
        period = as_kind("model", self.model, LinearModel).sampling_period
        object.__setattr__(self, "sampling_period", period)

    @property
    def gain_function(self) -> FunctionPointer | None:
        """What computes the gain; None for Kalman's, which the loop has built in."""
        raise NotImplementedError

    @property
    def compiled_gain(self) -> Any:
        """The gain function as the loop takes it."""
        return None if self.gain_function is None else self.gain_function.compiled

    @property
    def gain_parameters(self) -> Array:
        """The parameters of the gain function."""
        return np.empty(0)

    def innovation_deviation(self, state: KalmanState) -> Array:
        """The standard deviations of the next row's innovation, shape (m,), if the model is right.

        Raises
        ------
        InputError
            If the state is not one of this filter.
        DivergenceError
            As `predict` and `correct`.
        """
        ahead = self.predict(self._checked(state).posterior, np.zeros(self.inputs))
        one = self.correct(ahead, np.zeros(self.measurements), np.zeros(self.inputs))
        return np.sqrt(np.diag(one.innovation_covariance))

    def predict(self, posterior: Gaussian, u: ArrayLike = ()) -> Gaussian:
        """Time update with the input that is held over the step, shape (p,).

        Gadsden et al. 2011, (11) and (12).

        Raises
        ------
        InputError
            If the input or the posterior has another size.
        DivergenceError
            If the posterior leaves the range of floating-point numbers; its time counts from there.
        """
        states, outputs = self._sizes
        posterior = check_posterior("posterior", posterior, len(states), len(outputs))
        mean, covariance = np.empty_like(posterior.mean), np.empty_like(posterior.covariance)
        predict(
            states, self.model.arrays, as_vector("u", u, self.model.inputs),
            for_loop(posterior.mean), for_loop(posterior.covariance), mean, covariance,
            new_work(len(states), len(outputs)),
        )  # fmt: skip
        return self._finite(Gaussian(mean, covariance, posterior.error))

    def correct(self, posterior: Gaussian, y: ArrayLike, u: ArrayLike = ()) -> Correction:
        """Measurement update of a predicted posterior (Gadsden et al. 2011, (13) to (19)).

        Raises
        ------
        InputError
            If y (nan: missing), its input or the posterior has another size.
        DivergenceError
            If the covariance of the innovation is not positive definite, or the posterior leaves
            the range of floating-point numbers; its time counts from there.
        """
        taken = as_samples("y", as_row("y", y), self.model.outputs, missing=True)[0]
        control = as_vector("u", u, self.model.inputs)
        states, outputs = self._sizes
        m = len(outputs)
        posterior = check_posterior("posterior", posterior, len(states), m)
        innovation, factor = np.full(m, np.nan), np.full((m, m), np.nan)
        if is_missing(taken):
            return Correction(posterior, innovation, factor, 0.0)
        after = copies(posterior)
        log_likelihood = correct(
            states, outputs, self.model.arrays, self.compiled_gain, self.gain_parameters, taken,
            control, *after, innovation, factor, new_work(len(states), m),
        )  # fmt: skip
        corrected = self._finite(Gaussian(*after), log_likelihood)
        spread = np.empty((m, m))
        write_innovation_covariance(innovation, factor, spread)
        return Correction(corrected, innovation, spread, log_likelihood)

    def _finite(self, posterior: Gaussian, log_likelihood: float = 0.0) -> Gaussian:
        if not np.isfinite(log_likelihood + posterior.mean.sum() + np.trace(posterior.covariance)):
            raise DivergenceError(type(self).__name__, 0.0)
        return posterior

    def _fill(self, state: KalmanState, record: Record) -> Rows:
        states, outputs = self._sizes
        n, m, k = len(states), len(outputs), len(record.y)
        after, fresh = copies(state.posterior), state.sample is None
        rows = new_rows(k, n, m)
        good = run_filter(
            states, outputs, self.model.arrays, *self._noise_of_rows(state), self.compiled_gain,
            self.gain_parameters, record.y, inputs_of_rows(state.sample, record), fresh, *after,
            *rows,
        )  # fmt: skip
        return Rows(named(rows), good, self._after(state, record, Gaussian(*after)))
