"""Compiled loop of filters on nonlinear models, extended or unscented.

Where ``weights`` are None the filter is the extended one, which moves the covariance by Jacobians;
else they are those of sigma points. The compiler leaves out the branch that is not taken.

``states`` and ``outputs`` are tuples as in `reobserve.observers.linear_filter_loop`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import inlined_kernel, kernel
from reobserve.observers.extended_kalman_loop import correct_extended, predict_extended
from reobserve.observers.linear_filter_loop import (
    Size,
    assign,
    fill,
    is_missing,
    write_innovation_covariance,
)
from reobserve.observers.nonlinear_filter_work import (
    NO_INNOVATION,
    NO_POSTERIOR,
    NO_STATE,
    FilterWork,
)
from reobserve.observers.unscented_kalman_loop import Weights, correct_unscented, predict_unscented
from reobserve.systems.nonlinear_flow import Functions

Array = NDArray[np.float64]


@inlined_kernel
def predict(
    states: Size, functions: Functions, weights: Weights | None, Q: Array, u: Array, mean: Array,
    covariance: Array, next_mean: Array, next_covariance: Array, work: FilterWork,
) -> bool:  # fmt: skip
    """Time update; what is read and what is written may be the same arrays. False if it fails.

    The cross-covariance of x(k) and x(k+1) is left in ``work.cross``.
    """
    if weights is None:
        predict_extended(states, functions, Q, u, mean, covariance, next_covariance, work)
    elif not predict_unscented(functions, weights, Q, u, mean, covariance, next_covariance, work):
        return False
    total = 0.0
    for a in range(len(states)):
        next_mean[a] = work.moved[a]
        total += next_mean[a] + next_covariance[a, a]
    if not math.isfinite(total):
        work.cause[0] = NO_STATE
        return False
    return True


@inlined_kernel
def correct(
    states: Size, outputs: Size, functions: Functions, weights: Weights | None, R: Array, y: Array,
    u: Array, mean: Array, covariance: Array, innovation: Array, factor: Array, work: FilterWork,
) -> float:  # fmt: skip
    """Measurement update in place; return the log-likelihood, nan if it fails.

    ``innovation`` and ``factor`` are written: e and the lower Cholesky factor of its covariance S.
    """
    work.cause[0] = 0
    if weights is None:
        log_likelihood = correct_extended(
            states, outputs, functions, R, y, u, mean, covariance, innovation, factor, work
        )
    else:
        log_likelihood = correct_unscented(
            outputs, functions, weights, R, y, u, mean, covariance, innovation, factor, work
        )
    total = log_likelihood
    for a in range(len(states)):
        total += mean[a] + covariance[a, a]
    if math.isfinite(total):
        return log_likelihood
    if work.cause[0] == 0:
        work.cause[0] = NO_POSTERIOR if math.isfinite(log_likelihood) else NO_INNOVATION
    return math.nan


@kernel
def run_filter(
    states: Size,
    outputs: Size,
    functions: Functions,
    weights: Weights | None,
    Q: Array,
    R: Array,
    measurements: Array,
    inputs: Array,
    fresh: bool,
    mean: Array,
    covariance: Array,
    means: Array,
    covariances: Array,
    innovations: Array,
    innovation_covariances: Array,
    log_likelihoods: Array,
    factor: Array,
    work: FilterWork,
) -> tuple[int, int]:
    """Filter a record: fill the five arrays before scratch; return how many rows are good, and why.

    ``inputs`` has a row more than the record: the input of the row before, then that of each row;
    so has ``Q``, (., n, n). The last of ``Q`` and of ``R``, (., m, m), hold for all later rows.
    A ``fresh`` posterior is meant at the first row, which then corrects it as it stands; else it is
    meant a period before.
    """
    n = len(states)
    for k in range(len(measurements)):
        if k > 0 or not fresh:
            noise = Q[min(k, len(Q) - 1)]
            if not predict(
                states, functions, weights, noise, inputs[k], mean, covariance, mean, covariance,
                work,
            ):  # fmt: skip
                return k, work.cause[0]
        if is_missing(measurements[k]):
            fill(innovations[k], math.nan)
            log_likelihoods[k] = 0.0
        else:
            log_likelihoods[k] = correct(
                states, outputs, functions, weights, R[min(k, len(R) - 1)], measurements[k],
                inputs[k + 1], mean, covariance, innovations[k], factor, work,
            )  # fmt: skip
            if math.isnan(log_likelihoods[k]):
                return k, work.cause[0]
        write_innovation_covariance(innovations[k], factor, innovation_covariances[k])
        for a in range(n):
            means[k, a] = mean[a]
            for b in range(n):
                covariances[k, a, b] = covariance[a, b]
    return len(measurements), 0


@kernel
def predict_rows(
    states: Size,
    functions: Functions,
    weights: Weights | None,
    Q: Array,
    inputs: Array,
    means: Array,
    covariances: Array,
    next_means: Array,
    next_covariances: Array,
    crosses: Array,
    work: FilterWork,
) -> int:
    """Predict from each row to the next one; return how many rows could be.

    ``crosses`` become the cross-covariances of x(k) and x(k+1), shape (k, n, n).
    """
    for k in range(len(means)):
        if not predict(
            states, functions, weights, Q[min(k, len(Q) - 1)], inputs[k], means[k], covariances[k],
            next_means[k], next_covariances[k], work,
        ):  # fmt: skip
            return k
        for a in range(len(states)):
            assign(crosses[k, a], work.cross[a])
    return len(means)
