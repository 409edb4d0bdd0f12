"""Compiled steps of filters that correct a linear prediction by a gain times the innovation.

The Kalman filter, the SVSF and other filters differ in the gain alone: a function made by
`gain_function`, called through a pointer, so that these loops are compiled once for all of them.
They are compiled once for all sizes, too, but for those up to `UNROLLED`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.direct_call import call
from reobserve.core.kernel import inlined_kernel
from reobserve.observers.filter_rules import (
    Rules,
    gate,
    learn_noise,
    noise_of_row,
    shortest,
    wrap_states,
)

Array = NDArray[np.float64]

_MARGIN = 64  # numbers, 512 bytes: more than processors fetch at once

# Less of an output's variance is rounding, which moves estimates by over 1 % of their deviation.
ROUNDED = 32 * float(np.finfo(float).eps)

# S / R of a measurement above which a negative variance of the state is an error. Where it is
# smaller, the true variance is zero. In drawn plants S / R was 1e14 or more where a vague start had
# lost all digits, and 1e2 or less where a state was known.
VAGUE = 1e12

# Sizes up to this have loops of their own, 1.2 to 2.4 times as fast as those of all sizes, at the
# price of a second or two of compilation each: `benchmarks.kalman`. Five states are what the
# hydraulic actuator's banks have: their longest study takes a third less time.
UNROLLED = 5

HALF_LOG_TWO_PI = 0.5 * math.log(2.0 * math.pi)


class LinearWork(NamedTuple):
    """Scratch: products of shapes (n, n), (n,), (n, m), (n, m), (m,), and the factor of S, (m, m).

    ``noise``, (m, m), is R as it is used at a row, ``outlier``, (m,), the innovations beyond the
    gate in deviations, ``change``, (m,), what the row says of the variances of R, and ``column``,
    (m,), a column. ``states`` and ``outputs`` have the lengths n and m: tuples up to `UNROLLED`,
    whose lengths the compiler knows, and arrays beyond.
    """

    square: Array
    moved: Array
    cross: Array
    gain: Array
    scaled: Array
    factor: Array
    noise: Array
    outlier: Array
    change: Array
    column: Array
    states: Any
    outputs: Any
    rules: Rules


def new_linear_work(states: int, outputs: int, rules: Rules | None = None) -> LinearWork:
    """Scratch for one filter, without periods and gate if no rules are given.

    It is made in Python: to compile the allocation of arrays takes seconds. A margin keeps what
    threads write apart, so that they do not wait for each other's memory.
    """
    n, m = states, outputs
    shapes = (n, n), (n,), (n, m), (n, m), (m,), (m, m), (m, m), (m,), (m,), (m,)
    small = max(n, m) <= UNROLLED
    sizes = ((0,) * n, (0,) * m) if small else (np.empty(n), np.empty(m))
    plain = rules or Rules(np.zeros(n), np.zeros(m), math.inf, False, 0.0)
    return LinearWork(*blocks(shapes), *sizes, plain)  # type: ignore[call-arg, arg-type]


def blocks(shapes: Sequence[tuple[int, ...]]) -> Iterator[Array]:
    """Arrays of these shapes in one piece of memory, with a margin on both sides."""
    sizes = [math.prod(shape) for shape in shapes]
    whole, end = np.empty(sum(sizes) + 2 * _MARGIN), _MARGIN
    for shape, size in zip(shapes, sizes, strict=True):
        yield whole[end : end + size].reshape(shape)
        end += size


@inlined_kernel
def fill(target: Array, value: float) -> None:
    """Fill a vector with one value, as to assign to a slice takes the compiler seconds."""
    for i in range(len(target)):
        target[i] = value


@inlined_kernel
def assign(target: Array, source: Array) -> None:
    """A copy of a vector, as `fill`."""
    for i in range(len(target)):
        target[i] = source[i]


@inlined_kernel
def assign_matrix(target: Array, source: Array) -> None:
    """A copy of a matrix, as `fill`."""
    for i in range(len(target)):
        assign(target[i], source[i])


@inlined_kernel
def predict(
    A: Array,
    B: Array,
    Q: Array,
    control: Array,
    mean: Array,
    covariance: Array,
    next_mean: Array,
    next_covariance: Array,
    work: LinearWork,
) -> None:
    """Time update, in which what is read and what is written may be the same arrays.

    Gadsden et al. 2011, (1), (11) and (12).
    """
    n = len(work.states)
    square, moved = work.square, work.moved
    # x = A x + B u
    for a in range(n):
        total = 0.0
        for p in range(len(control)):
            total += B[a, p] * control[p]
        for b in range(n):
            total += A[a, b] * mean[b]
        moved[a] = total
    # P = (A P) A' + Q
    for a in range(n):
        next_mean[a] = shortest(moved[a], work.rules.state_periods[a])
        for b in range(n):
            total = 0.0
            for i in range(n):
                total += A[a, i] * covariance[i, b]
            square[a, b] = total
    for a in range(n):
        for b in range(a + 1):
            total = Q[a, b]
            for i in range(n):
                total += square[a, i] * A[b, i]
            next_covariance[a, b] = total
            next_covariance[b, a] = total
    clip_variances(next_covariance, work)


@inlined_kernel
def output_error(
    C: Array, D: Array, measurement: Array, control: Array, mean: Array, error: Array,
    work: LinearWork,
) -> None:  # fmt: skip
    """Write the measurement minus what ``mean`` predicts.

    Gadsden et al. 2011, (2), (3), (6), (14) and (18).
    """
    # e = y - D u - C x
    for o in range(len(work.outputs)):
        total = measurement[o]
        for p in range(D.shape[1]):
            total -= D[o, p] * control[p]
        for a in range(len(work.states)):
            total -= C[o, a] * mean[a]
        error[o] = shortest(total, work.rules.output_periods[o])


@inlined_kernel
def leave_out(o: int, factor: Array, work: LinearWork) -> None:
    """Write a one of its own for an output into the factor of S."""
    for q in range(len(work.outputs)):
        factor[o, q] = factor[q, o] = 0.0
    factor[o, o], work.scaled[o] = 1.0, 0.0


@inlined_kernel
def factor_innovation(innovation: Array, factor: Array, work: LinearWork) -> float:
    """Replace S, the lower triangle of ``factor``, by its factor L, and return the log-likelihood.

    It is nan if S is not positive definite by more than rounding. A missing output, of which the
    innovation is nan, gets a row with a one on the diagonal, and adds nothing to the likelihood.
    """
    m, scaled = len(work.outputs), work.scaled
    log_root, distance, taken = 0.0, 0.0, m
    for o in range(m):
        if math.isnan(innovation[o]):
            leave_out(o, factor, work)
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
                factor[o, o] = math.sqrt(total) if total > ROUNDED * factor[o, o] else math.nan
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
def log_likelihood_of(C: Array, covariance: Array, innovation: Array, work: LinearWork) -> float:
    """Write P C' and the Cholesky factor of S, and return the log-likelihood.

    Gadsden et al. 2011, (13) and (19).

    It is nan if S is not positive definite. A missing output, of which the innovation is nan, has
    a one of its own in S, which tells nothing and leaves the others alone.
    """
    n, m = len(work.states), len(work.outputs)
    cross, factor = work.cross, work.factor
    # P C'
    for a in range(n):
        for o in range(m):
            total = 0.0
            for b in range(n):
                total += covariance[a, b] * C[o, b]
            cross[a, o] = total
    # S = C (P C') + R
    for o in range(m):
        for q in range(o + 1):
            total = work.noise[o, q]
            for a in range(n):
                total += C[o, a] * cross[a, q]
            factor[o, q] = total
    gate(innovation, work)
    return factor_innovation(innovation, factor, work)


@inlined_kernel
def kalman_gain(work: LinearWork) -> None:
    """Solve K S = P C' by the Cholesky factor L of S."""
    cross, gain, factor = work.cross, work.gain, work.factor
    n, m = len(work.states), len(work.outputs)
    for a in range(n):
        # (K L) L' = P C'
        for o in range(m):
            total = cross[a, o]
            for i in range(o):
                total -= factor[o, i] * gain[a, i]
            gain[a, o] = total / factor[o, o]
        # K L = (K L)
        for back in range(m):
            o = m - 1 - back
            total = gain[a, o]
            for i in range(o + 1, m):
                total -= factor[i, o] * gain[a, i]
            gain[a, o] = total / factor[o, o]


@inlined_kernel
def correct_mean(mean: Array, innovation: Array, work: LinearWork) -> None:
    """Correct the mean, with zeros in the columns of K that belong to missing outputs."""
    # x = x + K e
    gain = work.gain
    for a in range(len(work.states)):
        for o in range(len(work.outputs)):
            if math.isnan(innovation[o]):
                gain[a, o] = 0.0
            else:
                mean[a] += gain[a, o] * innovation[o]
    wrap_states(mean, work)


@inlined_kernel
def correct_covariance(C: Array, covariance: Array, work: LinearWork) -> None:
    """Correct the covariance in Joseph's form, which holds for any gain.

    Gadsden et al. 2011, (17).

    M = I - K C itself is never formed, which saves two products of square matrices.
    """
    cross, gain, square, R = work.cross, work.gain, work.square, work.noise
    n, m = len(work.states), len(work.outputs)
    # T = M P = P - K (P C')'
    for a in range(n):
        for b in range(n):
            total = covariance[a, b]
            for o in range(m):
                total -= gain[a, o] * cross[b, o]
            square[a, b] = total
    # P = M P M' + K R K' = T - (T C' - K R) K'
    for a in range(n):
        for o in range(m):
            total = 0.0
            for b in range(n):
                total += square[a, b] * C[o, b]
            for q in range(m):
                total -= gain[a, q] * R[q, o]
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
    C: Array,
    D: Array,
    R: Array,
    variances: Array,
    weight: float,
    function: Callable[..., None] | None,
    parameters: Array,
    measurement: Array,
    control: Array,
    mean: Array,
    covariance: Array,
    error: Array,
    innovation: Array,
    work: LinearWork,
) -> float:
    """Correct in place by the measurement, and return the log-likelihood.

    Gadsden et al. 2011, (5) and (16).

    No function means the Kalman gain, which is compiled into the loop.

    ``innovation`` is written, e(k+1|k), and so are the gain and the lower Cholesky factor of S in
    ``work``. Outputs that are missing, nan, correct nothing; the others correct as if these alone
    were measured. ``variances`` of R and the ``weight`` of this row are read where R is estimated;
    what the row says of them is left in ``work.change``.
    """
    # e = y - C x - D u, S = C P C' + R
    output_error(C, D, measurement, control, mean, innovation, work)
    noise_of_row(R, variances, work)
    log_likelihood = log_likelihood_of(C, covariance, innovation, work)
    if work.rules.forgetting > 0.0:
        learn_noise(innovation, weight, work)
    # K = P C' S^-1, or another gain
    if function is None:
        kalman_gain(work)
    else:
        call(function, (work.cross, work.factor, innovation, error, parameters, work.gain))
    # x = x + K e, P = (I - K C) P (I - K C)' + K R K'
    correct_mean(mean, innovation, work)
    correct_covariance(C, covariance, work)
    if below_zero(covariance, work):
        if is_vague(innovation, work):
            return math.nan
        clip_variances(covariance, work)
    # e(k|k) = y - C x - D u
    output_error(C, D, measurement, control, mean, work.scaled, work)
    for o in range(len(work.outputs)):
        if not math.isnan(innovation[o]):
            error[o] = work.scaled[o]
    return log_likelihood


@inlined_kernel
def clip_variances(covariance: Array, work: LinearWork) -> None:
    """Set negative variances to zero: the true ones are zero to rounding.

    The position of an oscillator is known, say, each time its velocity alone is uncertain.
    """
    for a in range(len(work.states)):
        if covariance[a, a] < 0.0:  # noqa: PLR1730  # nan stays
            covariance[a, a] = 0.0


@inlined_kernel
def is_vague(innovation: Array, work: LinearWork) -> bool:
    """True if a measurement was so much more precise than predicted that rounding decides."""
    vague = False
    for o in range(len(work.outputs)):
        total = 0.0
        for q in range(o + 1):
            total += work.factor[o, q] * work.factor[o, q]
        vague = vague or (not math.isnan(innovation[o]) and total > VAGUE * work.noise[o, o])
    return vague


@inlined_kernel
def below_zero(covariance: Array, work: LinearWork) -> bool:
    """True if a variance is negative."""
    negative = False
    for a in range(len(work.states)):
        negative = negative or covariance[a, a] < 0.0
    return negative


@inlined_kernel
def is_missing(measurement: Array) -> bool:
    """True if a sample was not taken: none of its measurements is there."""
    taken = False
    for value in measurement:
        taken = taken or not math.isnan(value)
    return not taken


@inlined_kernel
def write_innovation_covariance(innovation: Array, out: Array, work: LinearWork) -> None:
    """Write S, nan where an output is missing."""
    # S = L L'
    m, factor = len(work.outputs), work.factor
    for o in range(m):
        for q in range(o + 1):
            total = 0.0
            for i in range(q + 1):
                total += factor[o, i] * factor[q, i]
            if math.isnan(innovation[o]) or math.isnan(innovation[q]):
                total = math.nan
            out[o, q] = out[q, o] = total
