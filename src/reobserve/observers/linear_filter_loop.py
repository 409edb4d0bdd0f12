"""Compiled loops of filters that correct a linear prediction by a gain times the innovation.

The Kalman filter, the SVSF and other filters differ in the gain alone: a function made by
`gain_function`, called through a pointer, so that these loops are compiled once for all of them.

``states`` and ``outputs`` are tuples, as long as there are states and outputs. The length of a
tuple is known to the compiler, which unrolls the loops over it: twice as fast, at the price of a
second or two when a filter of a new size runs for the first time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.direct_call import call
from reobserve.core.kernel import FunctionPointer, inlined_kernel, kernel
from reobserve.systems.linear import ModelArrays

Array = NDArray[np.float64]
Size = tuple[int, ...]

HALF_LOG_TWO_PI = 0.5 * math.log(2.0 * math.pi)

_TALL, _FLAT = "float64[:, ::1]", "float64[::1]"
_SIGNATURE = f"void({_TALL}, {_TALL}, {_FLAT}, {_FLAT}, {_FLAT}, {_TALL})"


def gain_function(function: Callable[..., None]) -> FunctionPointer:
    """Make a gain function of ``function(cross, factor, innovation, error, parameters, gain)``.

    It writes the gain K, shape (n, m), to its last argument. ``cross`` is P C', shape (n, m), of
    the predicted covariance, ``factor`` the lower Cholesky factor of the innovation's covariance,
    shape (m, m), ``innovation`` e(k+1|k) and ``error`` the filter's own a posteriori output error
    e(k|k), both of shape (m,), and ``parameters`` what the filter put there.
    """
    return FunctionPointer(_SIGNATURE, function)


class LinearFilterWork(NamedTuple):
    """Scratch of one filter: products of shapes (n, n), (n,), (n, m), (n, m) and (m,)."""

    square: Array
    moved: Array
    cross: Array
    gain: Array
    scaled: Array


@inlined_kernel
def new_work(states: int, outputs: int) -> LinearFilterWork:
    """Scratch for `predict` and `correct`."""
    tall = (states, outputs)
    return LinearFilterWork(
        np.empty((states, states)), np.empty(states), np.empty(tall), np.empty(tall),
        np.empty(outputs),
    )  # fmt: skip


@inlined_kernel
def fill(target: Array, value: float) -> None:
    """A vector of one value; to assign to a slice takes the compiler seconds, for its refusals."""
    for i in range(len(target)):
        target[i] = value


@inlined_kernel
def assign(target: Array, source: Array) -> None:
    """A copy of a vector, as `fill`."""
    for i in range(len(target)):
        target[i] = source[i]


@inlined_kernel
def predict(
    states: Size,
    model: ModelArrays,
    control: Array,
    mean: Array,
    covariance: Array,
    next_mean: Array,
    next_covariance: Array,
    work: LinearFilterWork,
) -> None:
    """Time update; what is read and what is written may be the same arrays.

    Gadsden et al. 2011, (1), (11) and (12).
    """
    n = len(states)
    square, moved = work.square, work.moved
    for a in range(n):
        total = 0.0
        for p in range(len(control)):
            total += model.B[a, p] * control[p]
        for b in range(n):
            total += model.A[a, b] * mean[b]
        moved[a] = total
    for a in range(n):
        next_mean[a] = moved[a]
        for b in range(n):
            total = 0.0
            for i in range(n):
                total += model.A[a, i] * covariance[i, b]
            square[a, b] = total
    for a in range(n):
        for b in range(a + 1):
            total = model.Q[a, b]
            for i in range(n):
                total += square[a, i] * model.A[b, i]
            next_covariance[a, b] = total
            next_covariance[b, a] = total


@inlined_kernel
def output_error(
    states: Size, model: ModelArrays, measurement: Array, control: Array, mean: Array, error: Array
) -> None:
    """Write the measurement minus what ``mean`` predicts.

    Gadsden et al. 2011, (2), (3), (6), (14) and (18).
    """
    for o in range(len(measurement)):
        total = measurement[o]
        for p in range(len(control)):
            total -= model.D[o, p] * control[p]
        for a in range(len(states)):
            total -= model.C[o, a] * mean[a]
        error[o] = total


@inlined_kernel
def leave_out(o: int, factor: Array, scaled: Array) -> None:
    """Write a one of its own for an output into the factor of S."""
    for q in range(len(scaled)):
        factor[o, q] = factor[q, o] = 0.0
    factor[o, o], scaled[o] = 1.0, 0.0


@inlined_kernel
def factor_innovation(innovation: Array, factor: Array, scaled: Array) -> float:
    """Replace S by its lower Cholesky factor L; return the log-likelihood, nan if it has none.

    S is read from the lower triangle of ``factor``. A missing output, of which the innovation is
    nan, gets a row of its own with a one on the diagonal, and adds nothing to the likelihood.
    """
    m = len(innovation)
    log_root, distance, taken = 0.0, 0.0, m
    for o in range(m):
        if math.isnan(innovation[o]):
            leave_out(o, factor, scaled)
            taken -= 1
            continue
        # L L' = S, row by row
        for q in range(o + 1):
            if math.isnan(innovation[q]):
                factor[o, q] = factor[q, o] = 0.0
                continue
            total = factor[o, q]
            for i in range(q):
                total -= factor[o, i] * factor[q, i]
            if o == q:
                factor[o, o] = math.sqrt(total) if total > 0.0 else math.nan
            else:
                factor[o, q] = total / factor[q, q]
                factor[q, o] = 0.0
        # L s = e, of which the squares add up to e' S^-1 e
        total = innovation[o]
        for i in range(o):
            total -= factor[o, i] * scaled[i]
        scaled[o] = total / factor[o, o]
        distance += scaled[o] * scaled[o]
        log_root += math.log(factor[o, o])
    return -0.5 * distance - log_root - taken * HALF_LOG_TWO_PI


@inlined_kernel
def log_likelihood_of(
    states: Size,
    outputs: Size,
    model: ModelArrays,
    covariance: Array,
    innovation: Array,
    factor: Array,
    work: LinearFilterWork,
) -> float:
    """Write P C' and the Cholesky factor of S; return the log-likelihood.

    Gadsden et al. 2011, (13) and (19).

    It is nan if S is not positive definite. A missing output, of which the innovation is nan, has
    a one of its own in S, which tells nothing and leaves the others alone.
    """
    n, m = len(states), len(outputs)
    cross, scaled = work.cross, work.scaled
    for a in range(n):
        for o in range(m):
            total = 0.0
            for b in range(n):
                total += covariance[a, b] * model.C[o, b]
            cross[a, o] = total
    # S = C P C' + R
    for o in range(m):
        for q in range(o + 1):
            total = model.R[o, q]
            for a in range(n):
                total += model.C[o, a] * cross[a, q]
            factor[o, q] = total
    return factor_innovation(innovation, factor, scaled)


@inlined_kernel
def kalman_gain(outputs: Size, factor: Array, work: LinearFilterWork) -> None:
    """Solve K S = P C' by the Cholesky factor L of S: K L first, then K."""
    m = len(outputs)
    cross, gain = work.cross, work.gain
    for a in range(len(cross)):
        for o in range(m):
            total = cross[a, o]
            for i in range(o):
                total -= factor[o, i] * gain[a, i]
            gain[a, o] = total / factor[o, o]
        for back in range(m):
            o = m - 1 - back
            total = gain[a, o]
            for i in range(o + 1, m):
                total -= factor[i, o] * gain[a, i]
            gain[a, o] = total / factor[o, o]


@inlined_kernel
def correct_covariance(
    states: Size, outputs: Size, model: ModelArrays, covariance: Array, work: LinearFilterWork
) -> None:
    """In Joseph's form for any gain: with M = I - K C, first T = M P, then T M' + K R K'.

    Gadsden et al. 2011, (17).

    M itself is never formed, which saves two products of square matrices.
    """
    n, m = len(states), len(outputs)
    cross, gain, square = work.cross, work.gain, work.square
    for a in range(n):
        for b in range(n):
            total = covariance[a, b]
            for o in range(m):
                total -= gain[a, o] * cross[b, o]
            square[a, b] = total
    for a in range(n):
        for o in range(m):
            total = 0.0
            for b in range(n):
                total += square[a, b] * model.C[o, b]
            for q in range(m):
                total -= gain[a, q] * model.R[q, o]
            cross[a, o] = total
    for a in range(n):
        for b in range(a + 1):
            total = square[a, b]
            for o in range(m):
                total -= cross[a, o] * gain[b, o]
            covariance[a, b] = total
            covariance[b, a] = total


@inlined_kernel
def correct(
    states: Size,
    outputs: Size,
    model: ModelArrays,
    function: Callable[..., None] | None,
    parameters: Array,
    measurement: Array,
    control: Array,
    mean: Array,
    covariance: Array,
    error: Array,
    innovation: Array,
    factor: Array,
    work: LinearFilterWork,
) -> float:
    """Measurement update in place; return the log-likelihood.

    Gadsden et al. 2011, (5) and (16).

    No function means the Kalman gain, which is compiled into the loop.

    ``innovation`` and ``factor`` are written: e(k+1|k) and the lower Cholesky factor of S. Outputs
    that are missing, nan, correct nothing; the others correct as if these alone were measured.
    """
    output_error(states, model, measurement, control, mean, innovation)
    log_likelihood = log_likelihood_of(states, outputs, model, covariance, innovation, factor, work)
    if function is None:
        kalman_gain(outputs, factor, work)
    else:
        call(function, (work.cross, factor, innovation, error, parameters, work.gain))
    for a in range(len(states)):
        for o in range(len(outputs)):
            if math.isnan(innovation[o]):
                work.gain[a, o] = 0.0
            else:
                mean[a] += work.gain[a, o] * innovation[o]
    correct_covariance(states, outputs, model, covariance, work)
    output_error(states, model, measurement, control, mean, work.scaled)
    for o in range(len(outputs)):
        if not math.isnan(innovation[o]):
            error[o] = work.scaled[o]
    return log_likelihood


@inlined_kernel
def is_missing(measurement: Array) -> bool:
    """Whether a sample was not taken: none of its measurements is there."""
    taken = False
    for value in measurement:
        taken = taken or not math.isnan(value)
    return not taken


@inlined_kernel
def write_innovation_covariance(innovation: Array, factor: Array, out: Array) -> None:
    """S = L L', nan where an output is missing."""
    m = len(innovation)
    for o in range(m):
        for q in range(o + 1):
            total = 0.0
            for i in range(q + 1):
                total += factor[o, i] * factor[q, i]
            if math.isnan(innovation[o]) or math.isnan(innovation[q]):
                total = math.nan
            out[o, q] = out[q, o] = total


@kernel
def run_filter(
    states: Size,
    outputs: Size,
    model: ModelArrays,
    Q: Array,
    R: Array,
    function: Callable[..., None] | None,
    parameters: Array,
    measurements: Array,
    inputs: Array,
    fresh: bool,
    mean: Array,
    covariance: Array,
    error: Array,
    means: Array,
    covariances: Array,
    innovations: Array,
    innovation_covariances: Array,
    log_likelihoods: Array,
) -> int:
    """Filter a record: fill the last five arguments, and return the number of good rows.

    ``inputs`` has a row more than the record: the input of the row before, then that of each row;
    so has ``Q``, (., n, n). The last of ``Q`` and of ``R``, (., m, m), hold for all later rows.
    A ``fresh`` posterior is meant at the first row, which then corrects it as it stands; else it is
    meant a period before.
    """
    n, m = len(states), len(outputs)
    factor, work = np.empty((m, m)), new_work(n, m)
    for k in range(len(measurements)):
        noisy = ModelArrays(
            model.A, model.B, model.C, model.D, Q[min(k, len(Q) - 1)], R[min(k, len(R) - 1)]
        )
        if k > 0 or not fresh:
            predict(states, noisy, inputs[k], mean, covariance, mean, covariance, work)
        if is_missing(measurements[k]):
            fill(innovations[k], math.nan)
            log_likelihoods[k] = 0.0
        else:
            log_likelihoods[k] = correct(
                states, outputs, noisy, function, parameters, measurements[k], inputs[k + 1],
                mean, covariance, error, innovations[k], factor, work,
            )  # fmt: skip
        write_innovation_covariance(innovations[k], factor, innovation_covariances[k])
        total = log_likelihoods[k]
        for a in range(n):
            means[k, a] = mean[a]
            for b in range(n):
                covariances[k, a, b] = covariance[a, b]
            total += mean[a] + covariance[a, a]
        if not math.isfinite(total):
            return k
    return len(measurements)
