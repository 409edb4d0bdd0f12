"""The two halves of a filter's step, which a bank of filters calls one by one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import DivergenceError
from reobserve.core.loop_function import RaisedAfterLoop
from reobserve.core.matrices import as_row, as_samples, as_vector
from reobserve.core.value import for_loop
from reobserve.observers.filter_records import posteriors_of
from reobserve.observers.gaussian_state import Correction, Gaussian, KalmanState, check_posterior

if TYPE_CHECKING:
    from reobserve.observers.gaussian_filter import GaussianFilter

Array = NDArray[np.float64]


def predict(observer: GaussianFilter, posterior: Gaussian, u: ArrayLike) -> Gaussian:
    """`GaussianFilter.predict`."""
    n, m = observer.whole.states, observer.whole.outputs
    posterior = check_posterior("posterior", posterior, n, m)
    control = as_vector("u", u, observer.whole.inputs)
    model, inputs, _ = observer._in_record({}, np.empty((1, m)), np.array([[control, control]]))
    mean, covariances, work = np.empty((1, n)), np.empty((2, 1, n, n)), observer._work()
    with RaisedAfterLoop():
        good = observer.steps.predict(
            model, observer.method, inputs[0], for_loop(posterior.mean)[None],
            for_loop(posterior.covariance)[None], mean, *covariances, work,
        )  # fmt: skip
    if not good:
        cause = int(work.cause[0]) if hasattr(work, "cause") else 0
        raise DivergenceError(type(observer).__name__, 0.0, observer.steps.causes.get(cause, ""))
    return Gaussian(mean[0], covariances[0, 0], posterior.error)


def correct(
    observer: GaussianFilter, posterior: Gaussian, y: ArrayLike, u: ArrayLike
) -> Correction:
    """`GaussianFilter.correct`."""
    n, m = observer.whole.states, observer.whole.outputs
    taken = as_samples("y", as_row("y", y), m, missing=True)[0]
    control = as_vector("u", u, observer.whole.inputs)
    posterior = check_posterior("posterior", posterior, n, m)
    if np.isnan(taken).all():
        return Correction(posterior, np.full(m, np.nan), np.full((m, m), np.nan), 0.0)
    model, inputs, _ = observer._in_record({}, taken[None], np.array([[control, control]]))
    after = posteriors_of(observer, [KalmanState(posterior, noise=observer._start_noise)])
    rows, _, ends = observer._filtered(model, inputs, taken[None, None], True, after)
    if not ends[0, 0]:
        raise DivergenceError(
            type(observer).__name__, 0.0, observer.steps.causes.get(ends[0, 1], "")
        )
    return Correction(
        Gaussian(*(part[0] for part in after[:3])), rows.innovation[0, 0],
        rows.innovation_covariance[0, 0], float(rows.log_likelihood[0, 0]),
    )  # fmt: skip


def innovation_deviation(observer: GaussianFilter, state: KalmanState) -> Array:
    """The standard deviations of the next row's innovation, shape (m,), if the model is right.

    It raises what `predict` and `correct` do.
    """
    ahead = predict(observer, observer._checked(state).posterior, np.zeros(observer.inputs))
    row = correct(observer, ahead, np.zeros(observer.measurements), np.zeros(observer.inputs))
    return np.sqrt(np.diag(row.innovation_covariance))
