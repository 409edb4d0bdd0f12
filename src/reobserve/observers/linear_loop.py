"""The compiled loop of filters on linear models, and what it writes."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import inlined_kernel, kernel
from reobserve.observers.gain import Gain
from reobserve.observers.linear_steps import (
    LinearWork,
    assign_matrix,
    below_zero,
    correct,
    fill,
    is_missing,
    predict,
    write_innovation_covariance,
)
from reobserve.observers.vague_start import REMEDY
from reobserve.systems.linear import ModelRows

Array = NDArray[np.float64]

BEGUN = 20.0  # rows that the R of the model counts as, where it is estimated

# Why a filter stopped, and what is said of it.
NO_INNOVATION = 3
NO_INNOVATION_CAUSE = (
    "the covariance of the next innovation is not finite and positive definite, as it is to "
    "rounding if measurements of the same are too precise beside their prediction"
)

NEGATIVE = 6
NEGATIVE_CAUSE = f"rounding makes a variance of the state negative at the next sample; {REMEDY}"
CAUSES = {NO_INNOVATION: NO_INNOVATION_CAUSE, NEGATIVE: NEGATIVE_CAUSE}


class FilterRows(NamedTuple):
    """The estimates of filters by their names: (records, k, ...).

    ``outlier`` and ``noise_variance`` have one row, which is overwritten, if nobody wants them.
    """

    state: Array
    covariance: Array
    innovation: Array
    innovation_covariance: Array
    log_likelihood: Array
    outlier: Array
    noise_variance: Array


class PredictedRows(NamedTuple):
    """Predictions and gains that filters keep if asked for, by their names, (records, k, ...)."""

    predicted_state: Array
    predicted_covariance: Array
    gain: Array


class FilterPosteriors(NamedTuple):
    """Means (records, n), covariances (records, n, n) and output errors (records, m).

    ``noises``, (records, m), are the variances of R where it is estimated, and ``counts``,
    (records,), the numbers of rows that they have been estimated from.
    """

    means: Array
    covariances: Array
    errors: Array
    noises: Array
    counts: Array


@inlined_kernel
def keep_prediction(mean: Array, covariance: Array, kept: PredictedRows, r: int, k: int) -> None:
    """Write the predicted mean and covariance of a row, and no gain yet."""
    for a in range(len(mean)):
        kept.predicted_state[r, k, a] = mean[a]
        for b in range(len(mean)):
            kept.predicted_covariance[r, k, a, b] = covariance[a, b]
        for o in range(kept.gain.shape[3]):
            kept.gain[r, k, a, o] = 0.0


@inlined_kernel
def keep_row(
    mean: Array, covariance: Array, innovation: Array, work: LinearWork, rows: FilterRows,
    r: int, k: int,
) -> float:  # fmt: skip
    """Write the posterior of a row and S, and return a sum that is finite if all of it is."""
    write_innovation_covariance(innovation, rows.innovation_covariance[r, k], work)
    total: float = rows.log_likelihood[r, k]
    n = len(work.states)
    for o in range(len(work.outputs)):
        rows.outlier[r, min(k, rows.outlier.shape[1] - 1), o] = work.outlier[o]
    for a in range(n):
        rows.state[r, k, a] = mean[a]
        for b in range(n):
            rows.covariance[r, k, a, b] = covariance[a, b]
        total += mean[a] + covariance[a, a]
    return total


@inlined_kernel
def weight_of_row(posteriors: FilterPosteriors, r: int, k: int, forgetting: float) -> float:
    """The weight of row k in the variances of R: at first that of a mean with `BEGUN` rows more."""
    return max(forgetting, 1.0 / (float(posteriors.counts[r]) + k + BEGUN))


@inlined_kernel
def keep_noise(
    posteriors: FilterPosteriors, taken: bool, rows: FilterRows, r: int, k: int, work: LinearWork
) -> None:
    """Change the variances of R by a row, if it was taken, and write them."""
    if work.rules.forgetting == 0.0:
        return
    noise = posteriors.noises[r]
    for o in range(len(noise)):
        if taken:
            noise[o] += work.change[o]
        rows.noise_variance[r, k, o] = noise[o]


@kernel
def run_linear(
    model: ModelRows,
    gain: Gain,
    measurements: Array,
    inputs: Array,
    fresh: bool,
    posteriors: FilterPosteriors,
    rows: FilterRows,
    kept: PredictedRows | None,
    work: LinearWork,
    ends: NDArray[np.int64],
) -> None:
    """Filter records: fill the rows, move the posteriors, count good rows.

    ``inputs`` has a row more than a record: the input of the row before, then that of each row; so
    have A, B and Q of the model. The last row of each matrix holds for all later ones. A ``fresh``
    posterior is meant at the first row, which then corrects it as it stands; else it is meant a
    period before. ``ends`` become the numbers of good rows and why the loop stopped, (records, 2).
    """
    count, due = measurements.shape[1], FIRST
    for r in range(len(measurements)):
        ends[r, 0] = ends[r, 1] = first = 0
        while first < count and ends[r, 0] == first:
            if r * count + first >= due:
                due = poll(r * count + first)
            last = min(count, due - r * count)
            _run_rows(
                model, gain, measurements, inputs, fresh, posteriors, rows, kept, work, ends, r,
                first, last,
            )  # fmt: skip
            first = last


@inlined_kernel
def _run_rows(
    model: ModelRows, gain: Gain, measurements: Array, inputs: Array, fresh: bool,
    posteriors: FilterPosteriors, rows: FilterRows, kept: PredictedRows | None, work: LinearWork,
    ends: NDArray[np.int64], r: int, first: int, last: int,
) -> None:  # fmt: skip
    """Filter the rows of a record from ``first`` to before ``last``."""
    A, B, C, D, Q, R = model
    mean, covariance, error = posteriors.means[r], posteriors.covariances[r], posteriors.errors[r]
    for k in range(first, last):
        y, innovation = measurements[r, k], rows.innovation[r, k]
        # x = A x + B u, P = A P A' + Q
        if k > 0 or not fresh:
            predict(
                A[min(k, len(A) - 1)], B[min(k, len(B) - 1)], Q[min(k, len(Q) - 1)],
                inputs[r, k], mean, covariance, mean, covariance, work,
            )  # fmt: skip
        if kept is not None:
            keep_prediction(mean, covariance, kept, r, k)
        missing = is_missing(y)
        if missing:
            fill(innovation, math.nan)
            fill(work.outlier, 0.0)
            rows.log_likelihood[r, k] = 0.0
        else:
            # x = x + K e, P = (I - K C) P (I - K C)' + K R K'
            rows.log_likelihood[r, k] = correct(
                C[min(k, len(C) - 1)], D[min(k, len(D) - 1)], R[min(k, len(R) - 1)],
                posteriors.noises[r], weight_of_row(posteriors, r, k, work.rules.forgetting),
                gain.function, gain.parameters, y, inputs[r, k + 1], mean, covariance, error,
                innovation, work,
            )  # fmt: skip
            if math.isnan(rows.log_likelihood[r, k]):
                ends[r, 1] = NEGATIVE if below_zero(covariance, work) else NO_INNOVATION
            if kept is not None:
                assign_matrix(kept.gain[r, k], work.gain)
        keep_noise(posteriors, not missing, rows, r, k, work)
        if not math.isfinite(keep_row(mean, covariance, innovation, work, rows, r, k)):
            break
        ends[r, 0] = k + 1


@kernel
def predict_linear(
    model: ModelRows, gain: Gain, inputs: Array, means: Array, covariances: Array,
    next_means: Array, next_covariances: Array, crosses: Array, work: LinearWork,
) -> int:  # fmt: skip
    """Predict from each row to the next one, and return how many rows could be.

    ``crosses`` become the cross-covariances of x(k) and x(k+1), shape (k, n, n).
    """
    n = next_means.shape[1]
    due = FIRST
    for k in range(len(next_means)):
        if k >= due:
            due = poll(k)
        # x = A x + B u, P = A P A' + Q
        A = model.A[min(k + 1, len(model.A) - 1)]
        B, Q = model.B[min(k + 1, len(model.B) - 1)], model.Q[min(k + 1, len(model.Q) - 1)]
        predict(
            A, B, Q, inputs[k + 1], means[k], covariances[k], next_means[k], next_covariances[k],
            work,
        )  # fmt: skip
        # cov(x(k), x(k+1)) = P A' = (A P)'
        total = 0.0
        for a in range(n):
            total += next_means[k, a] + next_covariances[k, a, a]
            for b in range(n):
                crosses[k, a, b] = work.square[b, a]
        if not math.isfinite(total):
            return k
    return len(next_means)
