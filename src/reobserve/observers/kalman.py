"""The Kalman filter (Kalman 1960), in predictor-corrector form with Joseph's covariance.

Its steps are those of all filters that correct a linear prediction by a gain times the innovation.
They differ in the gain alone: a function made by `gain_function`, called through a pointer, so that
`run_linear` is compiled once for all of them, and for all sizes but those up to `UNROLLED`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numba import types
from numpy.typing import ArrayLike, NDArray

from reobserve.core.direct_call import call
from reobserve.core.errors import InputError
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import FunctionPointer, inlined_kernel, kernel
from reobserve.core.large_matrices import COLUMNS, LARGE, mirror, multiply_rows, write_product
from reobserve.core.loop_function import GuardedPointer
from reobserve.observers.contract import OnDivergence, Sample
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import (
    REMEDY,
    TAKEN,
    Correlation,
    FilterPosteriors,
    FilterRows,
    FilterSteps,
    InRecord,
    KalmanState,
    PredictedRows,
    Rules,
)
from reobserve.observers.run import Estimate, Run
from reobserve.systems.linear import LinearModel, ModelArrays, ModelRows, as_matrices

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
BEGUN = 20.0  # rows that the R of the model counts as, where it is estimated
ROUNDING = 1e-12  # of a variance: how far below zero a pivot may be
_ROUNDING = 1e-10  # of a correlation: how far below zero an eigenvalue may be

# Why a filter stopped, and what is said of it.
NO_INNOVATION, NEGATIVE = 3, 6
NO_INNOVATION_CAUSE = (
    "the covariance of the next innovation is not finite and positive definite, as it is to "
    "rounding if measurements of the same are too precise beside their prediction"
)
NEGATIVE_CAUSE = f"rounding makes a variance of the state negative at the next sample; {REMEDY}"
CAUSES = {NO_INNOVATION: NO_INNOVATION_CAUSE, NEGATIVE: NEGATIVE_CAUSE}

_TALL, _FLAT = (types.Array(types.float64, size, "C") for size in (2, 1))
_SIGNATURE = types.void(_TALL, _TALL, _FLAT, _FLAT, _FLAT, _TALL)

own_gain_function = partial(FunctionPointer, _SIGNATURE)
"""As `gain_function`, for functions of the library, which raise nothing and change nothing."""


def _shaped(cross: Array, factor: Array, innovation: Array, *others: Array) -> tuple[Array, ...]:
    m = len(innovation)
    *vectors, gain = others
    return cross.reshape(-1, m), factor.reshape(m, m), innovation, *vectors, gain.reshape(-1, m)


def gain_function(function: Callable[..., None]) -> FunctionPointer:
    """Make a gain function of ``function(cross, factor, innovation, error, parameters, gain)``.

    It writes the gain K, shape (n, m), to its last argument. ``cross`` is P C', shape (n, m), of
    the predicted covariance, ``factor`` the lower Cholesky factor of the innovation's covariance,
    shape (m, m), ``innovation`` e(k+1|k) and ``error`` the filter's own a posteriori output error
    e(k|k), both of shape (m,), and ``parameters`` what the filter put there. What it raises is
    raised after the loop.
    """
    return GuardedPointer(_SIGNATURE, function, _shaped)


class Gain(NamedTuple):
    """A gain function and its parameters, or None for Kalman's, which the loops have built in."""

    function: Any
    parameters: Array


KALMAN = Gain(None, np.empty(0))


class LinearWork(NamedTuple):
    """Scratch: products of shapes (n, n), (n,), (n, m), (n, m), (m,), and the factor of S, (m, m).

    ``noise``, (m, m), is R as it is used at a row, ``outlier``, (m,), the innovations beyond the
    gate in deviations, ``change``, (m,), what the row says of the variances of R, and ``column``,
    (m,), a column. ``states`` and ``outputs`` have the lengths n and m: tuples up to `UNROLLED`,
    whose lengths the compiler knows, and arrays beyond. ``panel``, (n, 8), is for
    the products of models from `LARGE` on, and None for smaller ones.
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
    panel: Array | None


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
    panel = np.empty((n, COLUMNS)) if n >= LARGE else None
    return LinearWork(*blocks(shapes), *sizes, plain, panel)  # type: ignore[call-arg, arg-type]


def blocks(shapes: Sequence[tuple[int, ...]]) -> Iterator[Array]:
    """Arrays of these shapes in one piece of memory, with a margin on both sides."""
    sizes = [math.prod(shape) for shape in shapes]
    whole, end = np.empty(sum(sizes) + 2 * _MARGIN), _MARGIN
    for shape, size in zip(shapes, sizes, strict=True):
        yield whole[end : end + size].reshape(shape)
        end += size


@inlined_kernel
def fill(target: Array, value: float) -> None:
    """Fill a vector with one value."""
    # Assigning to a slice takes the compiler seconds.
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
def shortest(difference: float, period: float) -> float:
    """A difference of angles the shortest way round, as it is where the period is 0."""
    if period > 0.0:
        # d mod T, in [-T/2, T/2)
        return difference - period * math.floor(difference / period + 0.5)
    return difference


@inlined_kernel
def wrap_states(mean: Array, work: LinearWork) -> None:
    """Move angles among the states to within half a period around zero."""
    # x_a mod T_a, in [-T_a/2, T_a/2)
    for a in range(len(work.states)):
        mean[a] = shortest(mean[a], work.rules.state_periods[a])


@inlined_kernel
def gate(innovation: Array, work: LinearWork) -> None:
    """Leave out innovations beyond the gate, or inflate their variance so that they are on it.

    ``work.factor`` is the lower half of S, whose diagonal and that of R are inflated.
    """
    factor, gate = work.factor, work.rules.gate
    if gate == math.inf:
        return
    for o in range(len(work.outputs)):
        # |e_o| > gate sqrt(S_oo)
        deviations = innovation[o] / math.sqrt(factor[o, o])
        if abs(deviations) > gate:
            work.outlier[o] = deviations
            if work.rules.inflates:
                # R_oo = R_oo + e_o^2 / gate^2 - S_oo
                wider = (innovation[o] / gate) ** 2
                work.noise[o, o] += wider - factor[o, o]
                factor[o, o] = wider
            else:
                innovation[o] = math.nan


@inlined_kernel
def noise_of_row(R: Array, variances: Array, work: LinearWork) -> None:
    """Write R as it is used at a row to ``work.noise``: with the estimated variances v, if any."""
    noise, estimated = work.noise, work.rules.forgetting > 0.0
    # R_oq = R_oq sqrt(v_o v_q / (R_oo R_qq)), which leaves correlations as they are
    for o in range(len(work.outputs)):
        work.outlier[o] = 0.0
        for q in range(len(work.outputs)):
            noise[o, q] = R[o, q]
            if estimated and o == q:
                noise[o, q] = variances[o]
            elif estimated:
                noise[o, q] *= math.sqrt(variances[o] / R[o, o] * (variances[q] / R[q, q]))


@inlined_kernel
def weight_of_row(k: float, forgetting: float) -> float:
    """The weight of row k in the variances of R: at first that of a mean with `BEGUN` rows more."""
    # g = max(T / memory, 1 / (k + 20))
    return max(forgetting, 1.0 / (k + BEGUN))


@inlined_kernel
def learn_noise(innovation: Array, weight: float, work: LinearWork) -> None:
    """Write to ``work.change`` what a row changes of the variances of R, with its weight g.

    The expectation of v v' after the measurement, whose mean is R S^-1 e and whose covariance is
    R - R S^-1 R: a step of expectation maximisation (Shumway & Stoffer 1982) that forgets.
    """
    # change = g diag(R S^-1 (e e' - S) S^-1 R)
    m, column, factor = len(work.outputs), work.column, work.factor
    for o in range(m):
        work.change[o] = 0.0
        if math.isnan(innovation[o]) or work.outlier[o] != 0.0:
            continue
        mean, spread = 0.0, 0.0
        for q in range(m):
            # (R S^-1 e)_o = w' s,   (R S^-1 R)_oo = w' w,   where L w = R_o, L s = e
            total = 0.0 if math.isnan(innovation[q]) else work.noise[q, o]
            for i in range(q):
                total -= factor[q, i] * column[i]
            column[q] = total / factor[q, q]
            mean += column[q] * work.scaled[q]
            spread += column[q] * column[q]
        work.change[o] = weight * (mean * mean - spread)


@inlined_kernel
def predict(
    A: Array, B: Array, Q: Array, control: Array, mean: Array, covariance: Array,
    next_mean: Array, next_covariance: Array, work: LinearWork, panel: Array | None,
) -> None:  # fmt: skip
    """Time update, in which what is read and what is written may be the same arrays.

    Gadsden et al. 2011, (1), (11) and (12). ``panel`` is that of the scratch: numba leaves out
    the loops of large models where an argument is None.
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
    for a in range(n):
        next_mean[a] = shortest(moved[a], work.rules.state_periods[a])
    # P = (A P) A' + Q
    if panel is None:
        for a in range(n):
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
    else:
        # A P, then Q + (A P) A'
        write_product(A, covariance, False, None, square, False, panel)
        write_product(square, A, True, Q, next_covariance, True, panel)
        mirror(next_covariance)
    clip_variances(next_covariance, work)


@inlined_kernel
def clip_variances(covariance: Array, work: LinearWork) -> None:
    """Set negative variances to zero: the true ones are zero to rounding.

    The position of an oscillator is known, say, each time its velocity alone is uncertain.
    """
    # P_aa = max(P_aa, 0)
    for a in range(len(work.states)):
        if covariance[a, a] < 0.0:  # noqa: PLR1730  # nan stays
            covariance[a, a] = 0.0


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
    """Leave an output out of the factor of S."""
    # L_oo = 1,   L_oq = L_qo = 0,   s_o = 0
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
    # log N(e; 0, S) = -(e' S^-1 e + log det S + m log(2 pi)) / 2
    return -0.5 * distance - log_root - taken * HALF_LOG_TWO_PI


@inlined_kernel
def log_likelihood_of(
    C: Array, covariance: Array, innovation: Array, work: LinearWork, panel: Array | None
) -> float:
    """Write P C' and the Cholesky factor of S, and return the log-likelihood.

    Gadsden et al. 2011, (13) and (19). The likelihood is nan if S is not positive definite. A
    missing output, of which the innovation is nan, has a one of its own in S, which leaves the
    others as they are.
    """
    n, m = len(work.states), len(work.outputs)
    cross, factor = work.cross, work.factor
    # P C'
    if panel is None:
        for a in range(n):
            for o in range(m):
                total = 0.0
                for b in range(n):
                    total += covariance[a, b] * C[o, b]
                cross[a, o] = total
    else:
        multiply_rows(covariance, C, cross)
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
        # Z L' = P C'
        for o in range(m):
            total = cross[a, o]
            for i in range(o):
                total -= factor[o, i] * gain[a, i]
            gain[a, o] = total / factor[o, o]
        # K L = Z
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
def correct_covariance(C: Array, covariance: Array, work: LinearWork, panel: Array | None) -> None:
    """Correct the covariance in Joseph's form, which holds for any gain.

    Gadsden et al. 2011, (17). M = I - K C itself is never formed, which saves two products of
    square matrices.
    """
    cross, gain, square, R = work.cross, work.gain, work.square, work.noise
    n, m = len(work.states), len(work.outputs)
    if panel is None:
        # T = M P = P - K (P C')'
        for a in range(n):
            for b in range(n):
                total = covariance[a, b]
                for o in range(m):
                    total -= gain[a, o] * cross[b, o]
                square[a, b] = total
        # P = M P M' + K R K' = T - (T C' - K R) K', row by row
        for a in range(n):
            for o in range(m):
                total = 0.0
                for b in range(n):
                    total += square[a, b] * C[o, b]
                for q in range(m):
                    total -= gain[a, q] * R[q, o]
                cross[a, o] = total
            for b in range(a + 1):
                total = square[a, b]
                for o in range(m):
                    total -= cross[a, o] * gain[b, o]
                covariance[a, b] = total
                covariance[b, a] = total
    else:
        correct_large(C, covariance, square, cross, gain, R)
    clear_exact(covariance, work)


@inlined_kernel
def clear_exact(covariance: Array, work: LinearWork) -> None:
    """Set to zero what rounding leaves of variances that a measurement without noise took away."""
    for o in range(len(work.outputs)):
        if work.noise[o, o] != 0.0:
            continue
        variance = 0.0
        for q in range(o + 1):
            variance += work.factor[o, q] * work.factor[o, q]
        for a in range(len(work.states)):
            # P_aa = 0 where |P_aa| < K_ao^2 S_oo / VAGUE^2
            taken = (work.gain[a, o] / VAGUE) ** 2 * variance
            if abs(covariance[a, a]) < taken:
                for b in range(len(work.states)):
                    covariance[a, b] = covariance[b, a] = 0.0


@kernel
def correct_large(
    C: Array, covariance: Array, square: Array, cross: Array, gain: Array, R: Array
) -> None:
    """Correct the covariance by loops along rows."""
    n, m = cross.shape
    # T = M P = P - K (P C')'
    for a in range(n):
        for b in range(n):
            square[a, b] = covariance[a, b]
        for o in range(m):
            for b in range(n):
                square[a, b] -= gain[a, o] * cross[b, o]
    # T C' - K R
    multiply_rows(square, C, cross)
    for a in range(n):
        for o in range(m):
            for q in range(m):
                cross[a, o] -= gain[a, q] * R[q, o]
    # P = M P M' + K R K' = T - (T C' - K R) K'
    for a in range(n):
        for b in range(a + 1):
            covariance[a, b] = square[a, b]
        for o in range(m):
            for b in range(a + 1):
                covariance[a, b] -= cross[a, o] * gain[b, o]
    mirror(covariance)


@inlined_kernel
def below_zero(covariance: Array, work: LinearWork) -> bool:
    """True if a variance is negative."""
    negative = False
    for a in range(len(work.states)):
        negative = negative or covariance[a, a] < 0.0
    return negative


@inlined_kernel
def is_vague(innovation: Array, work: LinearWork) -> bool:
    """True if a measurement was so much more precise than predicted that rounding decides."""
    # S_oo = sum_q L_oq^2 > VAGUE R_oo
    vague = False
    for o in range(len(work.outputs)):
        total = 0.0
        for q in range(o + 1):
            total += work.factor[o, q] * work.factor[o, q]
        vague = vague or (not math.isnan(innovation[o]) and total > VAGUE * work.noise[o, o])
    return vague


@inlined_kernel
def correct(
    C: Array, D: Array, R: Array, variances: Array, weight: float,
    function: Callable[..., None] | None, parameters: Array, measurement: Array, control: Array,
    mean: Array, covariance: Array, error: Array, innovation: Array, work: LinearWork,
) -> float:  # fmt: skip
    """Correct in place by the measurement, and return the log-likelihood.

    Gadsden et al. 2011, (5) and (16). No function means the Kalman gain, which is compiled into the
    loop.

    ``innovation`` is written, e(k+1|k), and so are the gain and the lower Cholesky factor of S in
    ``work``. Outputs that are missing, nan, correct nothing; the others correct as if these alone
    were measured. ``variances`` of R and the ``weight`` of this row are read where R is estimated;
    what the row says of them is left in ``work.change``.
    """
    # e = y - C x - D u, S = C P C' + R
    output_error(C, D, measurement, control, mean, innovation, work)
    noise_of_row(R, variances, work)
    log_likelihood = log_likelihood_of(C, covariance, innovation, work, work.panel)
    if work.rules.forgetting > 0.0:
        learn_noise(innovation, weight, work)
    # K = P C' S^-1, or another gain
    if function is None:
        kalman_gain(work)
    else:
        call(function, (work.cross, work.factor, innovation, error, parameters, work.gain))
    # x = x + K e, P = (I - K C) P (I - K C)' + K R K'
    correct_mean(mean, innovation, work)
    correct_covariance(C, covariance, work, work.panel)
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


@inlined_kernel
def take_root(covariance: Array, root: Array) -> bool:
    """Write the lower Cholesky factor L of P = L L', or return False for a negative eigenvalue.

    Where P is singular a column of L is zero.
    """
    n = len(covariance)
    for j in range(n):
        for i in range(j):
            root[i, j] = 0.0
        # L_jj^2 = P_jj - sum_(i<j) L_ji^2
        pivot = covariance[j, j]
        for i in range(j):
            pivot -= root[j, i] * root[j, i]
        bound = ROUNDING * covariance[j, j]
        if not pivot >= -bound:  # nan, too
            return False
        singular = pivot <= 1e-4 * bound
        root[j, j] = 0.0 if singular else math.sqrt(pivot)
        # L_kj = (P_kj - sum_(i<j) L_ki L_ji) / L_jj
        for k in range(j + 1, n):
            total = covariance[k, j]
            for i in range(j):
                total -= root[k, i] * root[j, i]
            root[k, j] = 0.0 if singular else total / root[j, j]
    return True


@inlined_kernel
def solve_by_root(root: Array, cross: Array, gain: Array) -> None:
    """Solve G P = C by the factor L of P = L L'. C and G may be the same array.

    Where P is singular C is, too, and G is zero there.
    """
    n = len(root)
    for a in range(len(cross)):
        # Z L' = C
        for i in range(n):
            total = cross[a, i]
            for j in range(i):
                total -= root[i, j] * gain[a, j]
            gain[a, i] = total / root[i, i] if root[i, i] > 0.0 else 0.0
        # G L = Z
        for last in range(n):
            i = n - 1 - last
            total = gain[a, i]
            for j in range(i + 1, n):
                total -= root[j, i] * gain[a, j]
            gain[a, i] = total / root[i, i] if root[i, i] > 0.0 else 0.0


@inlined_kernel
def take_out(
    correlation: Correlation, k: int, j: int, C: Array, R: Array, variances: Array,
    innovation: Array, error: Array, work: LinearWork,
) -> None:  # fmt: skip
    """Write J C, J S' and J e(k|k) of the step from row k to the next one, of filter j.

        x(k+1) = A x(k) + B u(k) + w(k),  y(k) = C x(k) + D u(k) + v(k),  E[w v'] = S

    With J = S R^-1 the noise w - J v is not correlated with v, and v is y - C x - D u:

        x(k+1) = (A - J C) x(k) + B u(k) + J (y(k) - D u(k)) + [w - J v]
        cov(w - J v) = Q - J S',    J (y - D u) = J (e(k|k) + C x(k|k))

    R is ``work.noise``, which corrected the row; where it is estimated S keeps its correlations.
    An output of which the innovation is nan corrected nothing, and tells nothing of w.
    """
    gain, cross, factor, estimated = work.gain, work.cross, work.factor, work.rules.forgetting > 0.0
    S = correlation.S[min(k, len(correlation.S) - 1), j]
    transition, noise = correlation.transition[k + 1, j], correlation.noise[k + 1, j]
    n, m = len(work.states), len(work.outputs)
    # S_ao = S_ao sqrt(v_o / R_oo)
    for o in range(m):
        left = math.isnan(innovation[o])
        for q in range(m):
            none = left or math.isnan(innovation[q])
            factor[o, q] = 0.0 if none else work.noise[o, q]
        scale = math.sqrt(variances[o] / R[o, o]) if estimated else 1.0
        for a in range(n):
            cross[a, o] = 0.0 if left else S[a, o] * scale
    # J = S R^-1
    take_root(factor, factor)
    solve_by_root(factor, cross, gain)
    for a in range(n):
        known = 0.0
        for o in range(m):
            known += 0.0 if math.isnan(innovation[o]) else gain[a, o] * error[o]
        correlation.known[k + 1, j, a] = known
        for b in range(n):
            effect, spread = 0.0, 0.0
            for o in range(m):
                effect += gain[a, o] * C[o, b]
                spread += gain[a, o] * cross[b, o]
            transition[a, b] = effect
            if b <= a:
                noise[a, b] = noise[b, a] = spread


@inlined_kernel
def predict_row(
    A: Array, B: Array, Q: Array, correlation: Correlation | None, k: int, j: int, control: Array,
    own: Array, mean: Array, covariance: Array, next_mean: Array, next_covariance: Array,
    work: LinearWork,
) -> None:  # fmt: skip
    """Time update to row k of filter j, whose own mean is ``own`` and may be mixed to ``mean``."""
    if correlation is None:
        predict(A, B, Q, control, mean, covariance, next_mean, next_covariance, work, work.panel)
    else:
        transition, periods = correlation.transition[k, j], work.rules.state_periods
        less, rest, shift = correlation.A[k, j], correlation.Q[k, j], correlation.shift[k, j]
        # x = (A - J C) x + B u + J (e(k|k) + C x(k|k)), P = (A - J C) P (A - J C)' + Q - J S'
        for a in range(len(A)):
            shift[a] = correlation.known[k, j, a]
            for b in range(len(A)):
                less[a, b] = A[a, b] - transition[a, b]
                rest[a, b] = Q[a, b] - correlation.noise[k, j, a, b]
                x = mean[b] + shortest(own[b] - mean[b], periods[b])
                shift[a] += transition[a, b] * x
        predict(
            less, B, rest, control, mean, covariance, next_mean, next_covariance, work,
            work.panel,
        )  # fmt: skip
        for a in range(len(A)):
            next_mean[a] += shift[a]
        wrap_states(next_mean, work)


def correlation_of(
    S: ArrayLike | None, Q: Array, R: Array, rows: int, held: Mapping[str, Array], open_end: bool
) -> Correlation | None:
    """Arrays that loops read and write of S, (n, m) or (k, n, m), in a record of k rows.

    None without it, and if nothing of it is ``held`` from the row before, from which on Q is. With
    an ``open_end`` the step from the last row is not known yet.
    """
    if S is None and "noise" not in held:
        return None
    n, m = Q.shape[1], R.shape[1]
    (transition, noise, A, less), (known, shift) = (
        np.zeros((count, rows + 1, 1, *shape)) for count, shape in ((4, (n, n)), (2, (n,)))
    )
    if "noise" in held:
        transition[0], noise[0], known[0] = (held[name] for name in TAKEN)
        # In units of the noise, so that what is allowed does not depend on those of the states.
        sizes = np.sqrt(Q[0].diagonal())
        sizes[sizes == 0.0] = 1.0
        left = (Q[0] - held["noise"]) / np.outer(sizes, sizes)
        if np.linalg.eigvalsh(left)[0] < -_ROUNDING:
            raise InputError("S", "of the row before is more than Q of this step and R allow")
    crosses = np.zeros((0, n, m))
    if S is not None:
        crosses = as_matrices("S", S, (n, m), rows)
        _check(Q[1 : rows + (not open_end)] if len(Q) > 1 else Q, R, crosses)
    return Correlation(crosses[:, None], transition, noise, known, A, less, shift)


def _check(Q: Array, R: Array, S: Array) -> None:
    """Refuse an S for which noise of this Q and R cannot exist, each (1, ., .) or by row."""
    n, count = S.shape[1], max(map(len, (Q, R, S))) if len(Q) == 1 else len(Q)
    joint = np.zeros((count, n + S.shape[2], n + S.shape[2]))
    joint[:, :n, :n], joint[:, n:, n:] = Q, R[:count]
    joint[:, :n, n:], joint[:, n:, :n] = S[:count], S[:count].transpose(0, 2, 1)
    sizes = np.sqrt(joint.diagonal(axis1=1, axis2=2))
    sizes[sizes == 0.0] = 1.0
    with np.errstate(over="ignore"):  # no correlation is above 1
        joint = np.clip(joint / (sizes[:, :, None] * sizes[:, None, :]), -2.0, 2.0)
    low = np.linalg.eigvalsh(joint)[:, 0]
    if count and low.min() < -_ROUNDING:
        place = f"row {int(np.argmin(low))}" if count > 1 else "it"
        problem = f"is more than Q and R allow: with {place} [[Q, S], [S', R]] is no covariance"
        raise InputError("S", problem)


def linear_in_record(
    filter: GaussianFilter,  # noqa: A002
    given: Mapping[str, Any],
    y: Array,
    inputs: Array,
    held: Mapping[str, Array],
    periods: Array | None,
) -> InRecord:
    """The matrices of each row, and what of them leads on from the record.

    Raises
    ------
    InputError
        If a matrix that is given has another shape, or is no covariance.
    """
    model, names = filter.whole, ModelArrays._fields
    if not given and not held and periods is None:
        return InRecord(model.rows, inputs, {})
    matrices = {name: given[name] for name in given if name in names}
    rows = model.by_row(matrices, len(y), held, periods)
    after = {name: rows[name][-1] for name in ("A", "B", "Q") if name in given}
    open_end = periods is not None and "Q" not in given
    correlation = correlation_of(given.get("S"), rows["Q"], rows["R"], len(y), held, open_end)
    matrices = {name: np.ascontiguousarray(rows[name]) for name in names}
    return InRecord(ModelRows(**matrices, correlation=correlation), inputs, after)


@inlined_kernel
def is_missing(measurement: Array) -> bool:
    """True if a sample was not taken: none of its measurements is there."""
    taken = False
    for value in measurement:
        taken = taken or not math.isnan(value)
    return not taken


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
def keep_noise(
    posteriors: FilterPosteriors, taken: bool, rows: FilterRows, r: int, k: int, work: LinearWork
) -> None:
    """Change the variances of R by a row, if it was taken, and write them."""
    if work.rules.forgetting == 0.0:
        return
    # R = R + change
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
        ends[r, 0] = ends[r, 1] = 0
        first = ends[r, 0]  # a literal 0 would have the rows compiled for it, too
        while first < count and ends[r, 0] == first:
            if r * count + first >= due:
                due = poll(r * count + first)
            last = min(count, due - r * count)
            # x(k|k-1), P(k|k-1), then x(k|k), P(k|k)
            _run_rows(
                model, model.correlation, gain, measurements, inputs, fresh, posteriors, rows,
                kept, work, ends, r, first, last,
            )  # fmt: skip
            first = last


@inlined_kernel
def _run_rows(
    model: ModelRows, correlation: Correlation | None, gain: Gain, measurements: Array,
    inputs: Array, fresh: bool, posteriors: FilterPosteriors, rows: FilterRows,
    kept: PredictedRows | None, work: LinearWork, ends: NDArray[np.int64], r: int, first: int,
    last: int,
) -> None:  # fmt: skip
    """Filter the rows of a record from ``first`` to before ``last``."""
    A, B, C, D, Q, R = model[:6]
    mean, covariance, error = posteriors.means[r], posteriors.covariances[r], posteriors.errors[r]
    for k in range(first, last):
        y, innovation = measurements[r, k], rows.innovation[r, k]
        # x = A x + B u, P = A P A' + Q
        if k > 0 or not fresh:
            predict_row(
                A[min(k, len(A) - 1)], B[min(k, len(B) - 1)], Q[min(k, len(Q) - 1)], correlation,
                k, 0, inputs[r, k], mean, mean, covariance, mean, covariance, work,
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
                posteriors.noises[r],
                weight_of_row(posteriors.counts[r] + k, work.rules.forgetting),
                gain.function, gain.parameters, y, inputs[r, k + 1], mean, covariance, error,
                innovation, work,
            )  # fmt: skip
            if math.isnan(rows.log_likelihood[r, k]):
                ends[r, 1] = NEGATIVE if below_zero(covariance, work) else NO_INNOVATION
            if kept is not None:
                assign_matrix(kept.gain[r, k], work.gain)
        total = keep_row(mean, covariance, innovation, work, rows, r, k)
        if correlation is not None and len(correlation.S) > 0:
            take_out(
                correlation, k, 0, C[min(k, len(C) - 1)], R[min(k, len(R) - 1)],
                posteriors.noises[r], innovation, error, work,
            )  # fmt: skip
        keep_noise(posteriors, not missing, rows, r, k, work)
        if not math.isfinite(total):
            break
        ends[r, 0] = k + 1


LINEAR = FilterSteps(LinearModel, linear_in_record, run_linear, None, new_linear_work, CAUSES)
TAKES = ("A", "B", "C", "D", "Q", "R", "keep")


@dataclass(frozen=True, eq=False, repr=False)
class LinearFilter(GaussianFilter):
    """Base class of filters on linear models, which differ in the gain."""

    steps: ClassVar[FilterSteps] = LINEAR
    takes: ClassVar[tuple[str, ...]] = TAKES

    def step(
        self, start: KalmanState, y: Sample, u: Sample | None = None, *,
        time: float | None = None, A: ArrayLike | None = None, B: ArrayLike | None = None,
        C: ArrayLike | None = None, D: ArrayLike | None = None, Q: ArrayLike | None = None,
        R: ArrayLike | None = None, S: ArrayLike | None = None,
        keep: str | Sequence[str] | None = None,
    ) -> tuple[KalmanState, Estimate]:  # fmt: skip
        """Take one row: the start of the next one, and the estimates at it.

        Stepping through a record gives bitwise what `run` gives.

        Parameters
        ----------
        start
            From `init`, or from the row before.
        y, u, time, A, B, C, D, Q, R, S, keep
            As those of `run`, without the axis of rows. Of y and u also numbers by name, of
            which measurements may be left out.

        Raises
        ------
        InputError
            As `run`.
        DivergenceError
            As `run`.
        """
        given = {"A": A, "B": B, "C": C, "D": D, "Q": Q, "R": R, "S": S, "keep": keep}
        return self._step_given(start, y, u, time, given)

    def run(
        self, y: ArrayLike, u: ArrayLike | None = None, *, start: KalmanState | None = None,
        time: ArrayLike | None = None, A: ArrayLike | None = None, B: ArrayLike | None = None,
        C: ArrayLike | None = None, D: ArrayLike | None = None, Q: ArrayLike | None = None,
        R: ArrayLike | None = None, S: ArrayLike | None = None,
        keep: str | Sequence[str] | None = None, on_divergence: OnDivergence = "raise",
    ) -> Run[KalmanState]:  # fmt: skip
        """Estimates at all rows of a record, by one compiled loop.

        Parameters
        ----------
        y, u
            Measurements, shape (k, m), nan where missing, and known inputs, (k, p), from each row
            on; (k,) where m or p is 1, u left out where p is 0. Frames with the names of the
            model's signals, and many records, (records, k, m).
        start
            From `init`, or from an earlier run or step to go on with the row after its last.
        time
            Of the rows [s], shape (k,), or dates; left out, a sampling period apart. Of a model
            from `from_ode` with a density of the noise any that rise, but for augmented filters and
            with a ``noise_memory``, else a sampling period apart.
        A, B, C, D, Q, R
            In place of the model's, for this record: one for all rows, or one for each, (k, ., .).
            Those of row k in A, B and Q lead from row k to row k + 1; C, D and R are the row's own.
        S
            E[w v'], shape (n, m) or (k, n, m), of a filter with Kalman's gain: the covariance of
            the process noise from a row on with that row's measurement noise. Where R is estimated
            its correlations are kept.
        keep
            Names of what else the run shall hold: ``predicted_state``, (k, n), and
            ``predicted_covariance``, (k, n, n), before each measurement, and ``gain``, (k, n, m).
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `Run.diverged_at`.

        Raises
        ------
        InputError
            If a shape is wrong, a number is not finite, times do not fit, or the start is of
            another filter.
        DivergenceError
            If an estimate leaves the range of floating-point numbers, or rounding makes a variance
            negative; it says, where it is known, what would have helped.

        Examples
        --------
        >>> from reobserve import KalmanFilter, LinearModel
        >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2, sampling_period=0.1)
        >>> kalman = KalmanFilter(model)
        >>> start = kalman.init([0, 0], 1.0)
        >>> noisy = kalman.run([0.0, 0.11, 0.29], start=start, R=[[[1e-2]], [[1.0]], [[1e-2]]])
        >>> print(noisy["innovation_covariance"][1, 0, 0].round(3), noisy["state"][-1].round(2))
        1.02 [0.24 0.97]
        """
        given = {"A": A, "B": B, "C": C, "D": D, "Q": Q, "R": R, "S": S, "keep": keep}
        return self._run_given(y, u, start, time, on_divergence, given)


@dataclass(frozen=True, eq=False, repr=False)
class KalmanFilter(LinearFilter):
    """Kalman filter, the linear filter of minimum variance (Kalman 1960).

        x = A x + B u,              P = A P A' + Q
        e = y - C x - D u,          S = C P C' + R
        K = P C' S^-1,              x = x + K e
        P = (I - K C) P (I - K C)' + K R K'

    `init` takes the mean and the covariance of x. `run` and `step` take y, shape (k, m), nan where
    a measurement is missing, and u, (k, p). Estimates, in units of the model: ``state``, x, shape
    (k, n), ``covariance``, P, (k, n, n), and its diagonal ``variance``, (k, n), after each
    measurement; ``innovation``, e, (k, m), ``innovation_covariance``, S, (k, m, m), and
    ``log_likelihood``, (k,). With a ``gate`` there is also ``outlier``, (k, m), with a
    ``noise_memory`` ``noise_variance``, (k, m).

    Parameters
    ----------
    model
        The linear model of the plant.
    gate
        How many standard deviations an innovation may have, each output for itself. A fault that
        looks like outliers is rejected with them, so look at ``outlier``.
    outliers
        ``skip``: they count as missing; or ``inflate``: their variance of noise is raised so far
        that they are at the gate.
    noise_memory
        [s], of rows a sampling period apart. The diagonal of R is estimated, from that of the model
        on: R <- R + g diag(R S^-1 (e e' - S) S^-1 R), with the weight g = max(T / memory,
        1 / (k + 20)) of row k, expectation maximisation that forgets (Shumway & Stoffer 1982).

    Raises
    ------
    InputError
        If the model is of another kind, a number is not above zero; or R cannot be estimated, as it
        is less than a tenth of the innovation's variance: it would take a hundred memories.

    Examples
    --------
    >>> from reobserve import KalmanFilter, LinearModel
    >>> model = LinearModel([[1, 0.1], [0, 1]], C=[[1, 0]], Q=1e-4, R=1e-2, sampling_period=0.1)
    >>> kalman = KalmanFilter(model)
    >>> run = kalman.run([0.0, 0.11, float("nan"), 0.29], start=kalman.init([0, 0], 1.0))
    >>> print(run["state"][-1].round(2), run["variance"][-1].round(3))
    [0.26 0.79] [0.008 0.178]
    """

    model: LinearModel

    method = KALMAN
    has_kalman_gain: ClassVar[bool] = True
    takes: ClassVar[tuple[str, ...]] = (*TAKES, "S")
