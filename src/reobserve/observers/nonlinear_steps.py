"""Compiled loop of filters on nonlinear models, extended or unscented.

Where ``weights`` are None the filter is the extended one, which moves the covariance by Jacobians;
else they are those of sigma points. The compiler leaves out the branch that is not taken.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import inlined_kernel, kernel
from reobserve.observers.extended_kalman_loop import (
    correct_extended,
    extend_cross,
    predict_extended,
)
from reobserve.observers.filter_rules import noise_of_row, shortest
from reobserve.observers.linear_loop import (
    NEGATIVE,
    NO_INNOVATION,
    FilterPosteriors,
    FilterRows,
    PredictedRows,
    keep_noise,
    keep_prediction,
    keep_row,
    weight_of_row,
)
from reobserve.observers.linear_steps import (
    assign,
    assign_matrix,
    below_zero,
    clip_variances,
    fill,
    is_missing,
    is_vague,
)
from reobserve.observers.nonlinear_filter_work import (
    NO_POSTERIOR,
    NO_ROOT,
    NO_STATE,
    FilterWork,
)
from reobserve.observers.unscented_kalman_loop import (
    Weights,
    correct_unscented,
    extend_cross_by_root,
    predict_unscented,
)
from reobserve.systems.nonlinear_flow import NonlinearRows

Array = NDArray[np.float64]


@inlined_kernel
def predict(
    model: NonlinearRows, weights: Weights | None, k: int, u: Array, mean: Array,
    covariance: Array, next_mean: Array, next_covariance: Array, work: FilterWork,
) -> bool:  # fmt: skip
    """Time update to row k, in which what is read and what is written may be the same arrays.

    False if it fails. The cross-covariance of x(k-1) and x(k) is left in ``work.cross``.
    """
    functions, steps, Q = model.functions, model.steps, model.Q[min(k, len(model.Q) - 1)]
    parts, noisy = model.parts[min(k, len(model.parts) - 1)]
    for part in range(parts):
        noise = Q if part >= parts - noisy else work.no_noise
        if part > 0:
            assign_matrix(work.before, work.cross)
            mean, covariance = next_mean, next_covariance
        if weights is None:
            predict_extended(functions, steps, k, noise, u, mean, covariance, next_covariance, work)
            if part > 0:
                extend_cross(work)
        elif not predict_unscented(
            functions, weights, steps, k, noise, u, mean, covariance, next_covariance, work
        ):
            return False
        elif part > 0:
            extend_cross_by_root(work)
        total = 0.0
        for a in range(len(work.linear.states)):
            next_mean[a] = shortest(work.moved[a], work.linear.rules.state_periods[a])
            total += next_mean[a] + next_covariance[a, a]
        if not math.isfinite(total):
            work.cause[0] = NO_STATE
            return False
    if weights is None:
        clip_variances(next_covariance, work.linear)
    elif below_zero(next_covariance, work.linear):
        work.cause[0] = NO_ROOT
        return False
    return True


@inlined_kernel
def correct(
    model: NonlinearRows, weights: Weights | None, k: int, y: Array, u: Array, mean: Array,
    covariance: Array, innovation: Array, variances: Array, weight: float, work: FilterWork,
) -> float:  # fmt: skip
    """Correct in place by the measurement, and return the log-likelihood, nan if it fails.

    ``innovation`` is written, and the lower Cholesky factor of its covariance S to ``work``;
    ``variances`` and ``weight`` are those of `linear_steps.correct`.
    """
    functions = model.functions
    work.cause[0] = 0
    noise_of_row(model.R[min(k, len(model.R) - 1)], variances, work.linear)
    if weights is None:
        log_likelihood = correct_extended(
            functions, y, u, mean, covariance, innovation, weight, work
        )
    else:
        log_likelihood = correct_unscented(
            functions, weights, y, u, mean, covariance, innovation, weight, work
        )
    total = log_likelihood
    for a in range(len(work.linear.states)):
        total += mean[a] + covariance[a, a]
    if below_zero(covariance, work.linear):
        vague = is_vague(innovation, work.linear)
        if vague or weights is not None:
            work.cause[0] = NEGATIVE if vague else NO_ROOT
            return math.nan
        clip_variances(covariance, work.linear)
    if math.isfinite(total):
        return log_likelihood
    if work.cause[0] == 0:
        work.cause[0] = NO_POSTERIOR if math.isfinite(log_likelihood) else NO_INNOVATION
    return math.nan


@kernel
def run_nonlinear(
    model: NonlinearRows,
    weights: Weights | None,
    measurements: Array,
    inputs: Array,
    fresh: bool,
    posteriors: FilterPosteriors,
    rows: FilterRows,
    kept: PredictedRows | None,
    work: FilterWork,
    ends: NDArray[np.int64],
) -> None:
    """Filter records: fill the rows, move the posteriors, count good rows.

    ``ends`` become the numbers of good rows and why the loop stopped, (records, 2), keys of
    `reobserve.observers.nonlinear_filter.CAUSES`. ``inputs`` has a row more than a record:
    the input of the row before, then that of each row; so have Q and the steps of the model. A
    ``fresh`` posterior is meant at the first row, which then corrects it as it stands; else it is
    meant a period before.
    """
    count, due = measurements.shape[1], FIRST
    for r in range(len(measurements)):
        ends[r, 0] = ends[r, 1] = first = 0
        while first < count and ends[r, 0] == first:
            if r * count + first >= due:
                due = poll(r * count + first)
            last = min(count, due - r * count)
            _run_rows(
                model, weights, measurements, inputs, fresh, posteriors, rows, kept, work, ends, r,
                first, last,
            )  # fmt: skip
            first = last


@inlined_kernel
def _run_rows(
    model: NonlinearRows, weights: Weights | None, measurements: Array, inputs: Array, fresh: bool,
    posteriors: FilterPosteriors, rows: FilterRows, kept: PredictedRows | None, work: FilterWork,
    ends: NDArray[np.int64], r: int, first: int, last: int,
) -> None:  # fmt: skip
    """Filter the rows of a record from ``first`` to before ``last``."""
    mean, covariance = posteriors.means[r], posteriors.covariances[r]
    for k in range(first, last):
        y, innovation = measurements[r, k], rows.innovation[r, k]
        # x = f(x, u), P = A P A' + Q, or that of sigma points
        if (k > 0 or not fresh) and not predict(
            model, weights, k, inputs[r, k], mean, covariance, mean, covariance, work
        ):
            ends[r, 1] = work.cause[0]
            break
        if kept is not None:
            keep_prediction(mean, covariance, kept, r, k)
        missing = is_missing(y)
        if missing:
            fill(innovation, math.nan)
            fill(work.linear.outlier, 0.0)
            rows.log_likelihood[r, k] = 0.0
        else:
            # x = x + K (y - h(x, u)), P = (I - K C) P (I - K C)' + K R K'
            rows.log_likelihood[r, k] = correct(
                model, weights, k, y, inputs[r, k + 1], mean, covariance, innovation,
                posteriors.noises[r],
                weight_of_row(posteriors, r, k, work.linear.rules.forgetting), work,
            )  # fmt: skip
            if math.isnan(rows.log_likelihood[r, k]):
                ends[r, 1] = work.cause[0]
                break
            if kept is not None:
                assign_matrix(kept.gain[r, k], work.linear.gain)
        keep_noise(posteriors, not missing, rows, r, k, work.linear)
        keep_row(mean, covariance, innovation, work.linear, rows, r, k)
        ends[r, 0] = k + 1


@kernel
def predict_nonlinear(
    model: NonlinearRows, weights: Weights | None, inputs: Array, means: Array, covariances: Array,
    next_means: Array, next_covariances: Array, crosses: Array, work: FilterWork,
) -> int:  # fmt: skip
    """Predict from each row to the next one, and return how many rows could be.

    ``crosses`` become the cross-covariances of x(k) and x(k+1), shape (k, n, n).
    """
    due = FIRST
    for k in range(len(next_means)):
        if k >= due:
            due = poll(k)
        if not predict(
            model, weights, k + 1, inputs[k + 1], means[k], covariances[k], next_means[k],
            next_covariances[k], work,
        ):  # fmt: skip
            return k
        for a in range(len(work.cross)):
            assign(crosses[k, a], work.cross[a])
    return len(next_means)
