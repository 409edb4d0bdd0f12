"""The extended and the unscented Kalman filter, and their one compiled loop.

Where ``weights`` are None a filter is the extended one, which moves the covariance by Jacobians;
else they are those of scaled sigma points (Wan & van der Merwe 2000). The compiler leaves out the
branch that is not taken.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.covariances import as_covariances
from reobserve.core.direct_call import call
from reobserve.core.errors import InputError
from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import inlined_kernel, kernel
from reobserve.core.large_matrices import mirror, write_product
from reobserve.core.matrices import as_positive, as_scalar
from reobserve.core.value import for_loop
from reobserve.observers.contract import OnDivergence, Sample
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.gaussian_state import (
    Correlation,
    FilterPosteriors,
    FilterRows,
    FilterSteps,
    InRecord,
    KalmanState,
    PredictedRows,
    Rules,
    side_by_side,
)
from reobserve.observers.kalman import CAUSES as LINEAR_CAUSES
from reobserve.observers.kalman import (
    NEGATIVE,
    NO_INNOVATION,
    LinearWork,
    assign,
    assign_matrix,
    below_zero,
    blocks,
    clear_exact,
    clip_variances,
    correct_covariance,
    correct_mean,
    correlation_of,
    factor_innovation,
    fill,
    gate,
    is_missing,
    is_vague,
    kalman_gain,
    keep_noise,
    keep_prediction,
    keep_row,
    learn_noise,
    log_likelihood_of,
    new_linear_work,
    noise_of_row,
    shortest,
    solve_by_root,
    take_out,
    take_root,
    weight_of_row,
)
from reobserve.observers.run import Estimate, Run
from reobserve.systems.nonlinear import NonlinearModel
from reobserve.systems.nonlinear_arguments import values_by_row
from reobserve.systems.nonlinear_flow import (
    FlowWork,
    Functions,
    NonlinearRows,
    jacobian,
    move,
    move_and_derive,
    new_flow_work,
    write_sizes,
)

Array = NDArray[np.float64]

LONGER = 1e-3  # of a sampling period: how much longer the time to a row may be
MOST_PARTS = 10_000_000  # predictions in a gap, a second or more

# Why a filter stopped.
NO_STATE, NO_OUTPUT, NO_ROOT, NO_POSTERIOR = 1, 2, 4, 5  # beside NO_INNOVATION, 3
CAUSES = {
    NO_STATE: "f, or the covariance after it, is not finite at the next sample",
    NO_OUTPUT: "h is not finite at the next sample",
    **LINEAR_CAUSES,
    NO_ROOT: "the covariance of the state is no longer positive semidefinite, so that it has no "
    "Cholesky factor",
    NO_POSTERIOR: "the next correction is not finite",
}


class FilterWork(NamedTuple):
    """Scratch of the linear steps and of the model, sigma points and what becomes of them.

    ``no_noise``, (n, n), is zero. ``before`` is cov(x, x') of a row and of a part of the gap after
    it.
    """

    linear: LinearWork
    flow: FlowWork
    moved: Array
    root: Array
    points: Array
    images: Array
    cross: Array
    before: Array
    no_noise: Array
    cause: NDArray[np.int64]


def new_filter_work(states: int, outputs: int, rules: Rules | None = None) -> FilterWork:
    """Scratch for the steps of a filter."""
    n, m, most = states, outputs, max(states, outputs)
    shapes = (n,), (n, n), (2 * n + 1, n), (2 * n + 1, most), *((n, n),) * 3
    moved, root, points, images, cross, before, no_noise = blocks(shapes)
    no_noise[:] = 0.0
    cause = np.zeros(16, np.int64)[:1]
    return FilterWork(
        new_linear_work(n, m, rules), new_flow_work(n, m), moved, root, points, images, cross,
        before, no_noise, cause,
    )  # fmt: skip


@inlined_kernel
def innovate(y: Array, expected: Array, innovation: Array, work: FilterWork) -> bool:
    """Write y - h(x, u), nan where y is, and return whether h is finite."""
    # e = y - h(x, u)
    for o in range(len(work.linear.outputs)):
        if not math.isfinite(expected[o]):
            work.cause[0] = NO_OUTPUT
            return False
        innovation[o] = shortest(y[o] - expected[o], work.linear.rules.output_periods[o])
    return True


@inlined_kernel
def predict_extended(
    functions: Functions, correlation: Correlation | None, steps: Any, k: int, Q: Array, u: Array,
    mean: Array, covariance: Array, next_covariance: Array, work: FilterWork,
    panel: Array | None,
) -> None:  # fmt: skip
    """Write f(x, u) to ``work.moved``, the covariance, and cov(x(k-1), x(k)) to ``work.cross``."""
    # x = f(x, u), A = df/dx
    write_sizes(functions.numeric_f, functions.scale, mean, covariance, work.flow.sizes)
    move_and_derive(functions, steps, k, mean, u, work.moved, work.flow)
    A, cross, n = work.flow.A, work.cross, len(work.linear.states)
    if correlation is not None:
        # x = f(x, u) + J e(k|k), A = df/dx - J C, and Q - J S' in place of Q
        for a in range(n):
            work.moved[a] += correlation.known[k, 0, a]
            for b in range(n):
                A[a, b] -= correlation.transition[k, 0, a, b]
                correlation.Q[k, 0, a, b] = Q[a, b] - correlation.noise[k, 0, a, b]
        Q = correlation.Q[k, 0]
    if panel is None:
        # cov(x(k-1), x(k)) = P A'
        for a in range(n):
            for b in range(n):
                total = 0.0
                for i in range(n):
                    total += covariance[a, i] * A[b, i]
                cross[a, b] = total
        # P = Q + A (P A')
        for a in range(n):
            for b in range(a + 1):
                total = Q[a, b]
                for i in range(n):
                    total += A[a, i] * cross[i, b]
                next_covariance[a, b] = total
                next_covariance[b, a] = total
    else:
        # cov(x(k-1), x(k)) = P A'
        write_product(covariance, A, True, None, cross, False, panel)
        # P = Q + A (P A')
        write_product(A, cross, False, Q, next_covariance, True, panel)
        mirror(next_covariance)


@inlined_kernel
def take_out_extended(
    functions: Functions, correlation: Correlation, k: int, R: Array, variances: Array, y: Array,
    u: Array, mean: Array, covariance: Array, innovation: Array, work: FilterWork,
) -> None:  # fmt: skip
    """Write what S takes out of the step from row k to the next one, as `take_out`."""
    linear, flow, error = work.linear, work.flow, work.linear.column
    # C = dh/dx, e(k|k) = y - h(x, u)
    write_sizes(functions.numeric_h, functions.scale, mean, covariance, flow.sizes)
    jacobian(functions.h, functions.H, functions.numeric_h, mean, u, flow.C_flat, flow)
    expected = flow.values[0, : len(y)]
    call(functions.h, (mean, u, expected))
    fill(error, math.nan)
    innovate(y, expected, error, work)
    take_out(correlation, k, 0, flow.C, R, variances, innovation, error, linear)


@inlined_kernel
def correct_extended(
    functions: Functions, y: Array, u: Array, mean: Array, covariance: Array,
    innovation: Array, weight: float, work: FilterWork,
) -> float:  # fmt: skip
    """Correct in place by the measurement, and return the log-likelihood, nan if it fails.

    ``innovation`` is written, and the lower Cholesky factor of its covariance S to ``work``.
    """
    linear, flow = work.linear, work.flow
    # C = dh/dx
    write_sizes(functions.numeric_h, functions.scale, mean, covariance, flow.sizes)
    jacobian(functions.h, functions.H, functions.numeric_h, mean, u, flow.C_flat, flow)
    # e = y - h(x, u)
    expected = flow.values[0, : len(y)]
    call(functions.h, (mean, u, expected))
    if not innovate(y, expected, innovation, work):
        return math.nan
    # S = C P C' + R
    log_likelihood = log_likelihood_of(flow.C, covariance, innovation, linear, linear.panel)
    if linear.rules.forgetting > 0.0:
        learn_noise(innovation, weight, linear)
    # K = P C' S^-1
    kalman_gain(linear)
    # x = x + K e
    correct_mean(mean, innovation, linear)
    # P = (I - K C) P (I - K C)' + K R K'
    correct_covariance(flow.C, covariance, linear, linear.panel)
    return log_likelihood


class Weights(NamedTuple):
    """Weights of scaled sigma points (Wan & van der Merwe 2000).

    The points are x and x +- c times the columns of a root of P, where c is ``spread``. ``each`` is
    w, the weight of all but the first one, of which ``first`` is v_0, that in covariances.
    """

    spread: float
    each: float
    first: float


class Approximation(NamedTuple):
    """Weights of sigma points, or True for the extended filter, and None for the other one.

    numba leaves out branches of an argument that is None, but compiles those of one that is not.
    """

    weights: Weights | None
    extended: bool | None


@inlined_kernel
def place_points(mean: Array, covariance: Array, weights: Weights, work: FilterWork) -> bool:
    """Write the sigma points, or return False if P has no root."""
    n = len(work.linear.states)
    if not take_root(covariance, work.root):
        work.cause[0] = NO_ROOT
        return False
    # X_0 = x,   X_i = x + c L_i,   X_(n+i) = x - c L_i
    for a in range(n):
        work.points[0, a] = mean[a]
        for i in range(n):
            offset = weights.spread * work.root[a, i]
            work.points[1 + i, a] = mean[a] + offset
            work.points[1 + n + i, a] = mean[a] - offset
    return True


@inlined_kernel
def average_points(images: Array, weight: float, periods: Array, mean: Array) -> None:
    """Write the mean y of points Y, as the first one plus what the others differ from it by.

    All weights sum to one; so written, a large negative one does not cancel, and angles differ the
    shortest way round.
    """
    # y = sum w_i Y_i = Y_0 + w sum_(i>0) (Y_i - Y_0)
    for a in range(len(mean)):
        total = 0.0
        for i in range(1, len(images)):
            total += shortest(images[i, a] - images[0, a], periods[a])
        mean[a] = images[0, a] + weight * total


@inlined_kernel
def subtract(rows: Array, mean: Array, periods: Array) -> None:
    """Subtract the mean y from points Y, angles the shortest way round."""
    # d_i = Y_i - y
    for i in range(len(rows)):
        for a in range(len(mean)):
            rows[i, a] = shortest(rows[i, a] - mean[a], periods[a])


@inlined_kernel
def spread_of(images: Array, weights: Weights, noise: Array, out: Array) -> None:
    """Write the lower half of the covariance of deviations d, plus noise."""
    # sum v_i d_i d_i' + noise = noise + v_0 d_0 d_0' + w sum_(i>0) d_i d_i'
    for a in range(len(noise)):
        for b in range(a + 1):
            total = 0.0
            for i in range(1, len(images)):
                total += images[i, a] * images[i, b]
            central = weights.first * images[0, a] * images[0, b]
            out[a, b] = noise[a, b] + central + weights.each * total


@inlined_kernel
def cross_of(root: Array, images: Array, weights: Weights, cross: Array) -> None:
    """Write the cross-covariance of the points and the deviations d of their images."""
    n = len(root)
    # sum v_i (X_i - x) d_i' = w c sum_(i=1..n) L_i (d_i - d_(n+i))'
    for a in range(n):
        for b in range(cross.shape[1]):
            total = 0.0
            for i in range(n):
                total += root[a, i] * (images[1 + i, b] - images[1 + n + i, b])
            cross[a, b] = weights.each * weights.spread * total


@inlined_kernel
def predict_unscented(
    functions: Functions, weights: Weights, steps: Any, k: int, Q: Array, u: Array, mean: Array,
    covariance: Array, next_covariance: Array, work: FilterWork,
) -> bool:  # fmt: skip
    """Write x(k) to ``work.moved``, its covariance, and cov(x(k-1), x(k)) to ``work.cross``.

    False if P has no root.
    """
    n = len(work.linear.states)
    # X_0 = x,   X_i = x + c L_i,   X_(n+i) = x - c L_i
    if not place_points(mean, covariance, weights, work):
        return False
    images = work.images[:, :n]
    for i in range(2 * n + 1):
        move(functions, steps, k, work.points[i], u, work.moved, work.flow)
        assign(images[i], work.moved)
    # x(k) = sum w_i f(X_i)
    periods = work.linear.rules.state_periods
    average_points(images, weights.each, periods, work.moved)
    subtract(images, work.moved, periods)
    # cov(x(k-1), x(k)) = sum v_i (X_i - x) (f(X_i) - x(k))'
    cross_of(work.root, images, weights, work.cross)
    # P = sum v_i (f(X_i) - x(k)) (f(X_i) - x(k))' + Q
    spread_of(images, weights, Q, next_covariance)
    for a in range(n):
        for b in range(a):
            next_covariance[b, a] = next_covariance[a, b]
    return True


@inlined_kernel
def spread_after(
    R: Array, weights: Weights, gain: Array, points: Array, images: Array, covariance: Array
) -> None:
    """Write the covariance in Joseph's form, which is P - K S K' but for rounding."""
    n, m = gain.shape
    # r_i = (X_i - x) - K (h(X_i) - y)
    for i in range(len(points)):
        for a in range(n):
            for o in range(m):
                points[i, a] -= gain[a, o] * images[i, o]
    # P = sum v_i r_i r_i' + K R K'
    for a in range(n):
        for b in range(a + 1):
            total = 0.0
            for i in range(1, len(points)):
                total += points[i, a] * points[i, b]
            total = weights.each * total + weights.first * points[0, a] * points[0, b]
            for o in range(m):
                for q in range(m):
                    total += gain[a, o] * R[o, q] * gain[b, q]
            covariance[a, b] = total
            covariance[b, a] = total


@inlined_kernel
def correct_unscented(
    functions: Functions, weights: Weights, y: Array, u: Array, mean: Array,
    covariance: Array, innovation: Array, weight: float, work: FilterWork,
) -> float:  # fmt: skip
    """Correct in place by the measurement, and return the log-likelihood, nan if it fails.

    ``innovation`` is written, and the lower Cholesky factor of its covariance S to ``work``.
    """
    n, m = len(work.linear.states), len(work.linear.outputs)
    linear, expected = work.linear, work.flow.values[0, :m]
    if not place_points(mean, covariance, weights, work):
        return math.nan
    points, images = work.points, work.images[:, :m]
    for i in range(2 * n + 1):
        call(functions.h, (points[i], u, expected))
        assign(images[i], expected)
    # y = sum w_i h(X_i)
    periods, R = linear.rules.output_periods, linear.noise
    average_points(images, weights.each, periods, expected)
    if not innovate(y, expected, innovation, work):
        return math.nan
    # S = sum v_i (h(X_i) - y) (h(X_i) - y)' + R
    subtract(images, expected, periods)
    spread_of(images, weights, R, linear.factor)
    gate(innovation, linear)
    log_likelihood = factor_innovation(innovation, linear.factor, linear)
    if linear.rules.forgetting > 0.0:
        learn_noise(innovation, weight, linear)
    # K = sum v_i (X_i - x) (h(X_i) - y)' S^-1
    cross_of(work.root, images, weights, linear.cross)
    kalman_gain(linear)
    # x = x + K e
    for i in range(len(points)):
        for a in range(n):
            points[i, a] -= mean[a]
    correct_mean(mean, innovation, linear)
    # P = sum v_i r_i r_i' + K R K',   r_i = (X_i - x) - K (h(X_i) - y)
    spread_after(R, weights, linear.gain, points, images, covariance)
    clear_exact(covariance, linear)
    return log_likelihood


@inlined_kernel
def extend_cross(weights: Weights | None, extended: bool | None, work: FilterWork) -> None:
    """Write cov(x, x(k)) to ``work.cross``, from cov(x, x(k-1)), which is ``work.before``."""
    before, column, n = work.before, work.flow.point, len(work.before)
    if extended is not None:
        # cov(x, x(k)) = cov(x, x(k-1)) A'
        for a in range(n):
            for b in range(n):
                total = 0.0
                for i in range(n):
                    total += before[a, i] * work.flow.A[b, i]
                work.cross[a, b] = total
    if weights is not None:
        # cov(x, x(k)) = cov(x, x(k-1)) P^-1 cov(x(k-1), x(k)), where P = L L' is that of x(k-1)
        solve_by_root(work.root, before, before)
        for b in range(n):
            for i in range(n):
                column[i] = work.cross[i, b]
            for a in range(n):
                total = 0.0
                for i in range(n):
                    total += before[a, i] * column[i]
                work.cross[a, b] = total


@inlined_kernel
def predict(
    model: NonlinearRows, correlation: Correlation | None, weights: Weights | None,
    extended: bool | None, k: int, u: Array, mean: Array, covariance: Array, next_mean: Array,
    next_covariance: Array, work: FilterWork,
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
        # x = f(x, u), P = A P A' + Q, or those of sigma points
        if extended is not None:
            predict_extended(
                functions, correlation, steps, k, noise, u, mean, covariance, next_covariance,
                work, work.linear.panel,
            )  # fmt: skip
        if weights is not None and not predict_unscented(
            functions, weights, steps, k, noise, u, mean, covariance, next_covariance, work
        ):
            return False
        if part > 0:
            extend_cross(weights, extended, work)
        total = 0.0
        for a in range(len(work.linear.states)):
            next_mean[a] = shortest(work.moved[a], work.linear.rules.state_periods[a])
            total += next_mean[a] + next_covariance[a, a]
        if not math.isfinite(total):
            work.cause[0] = NO_STATE
            return False
    if extended is not None:
        clip_variances(next_covariance, work.linear)
    elif below_zero(next_covariance, work.linear):
        work.cause[0] = NO_ROOT
        return False
    return True


@inlined_kernel
def correct(
    model: NonlinearRows, weights: Weights | None, extended: bool | None, k: int, y: Array,
    u: Array, mean: Array, covariance: Array, innovation: Array, variances: Array, weight: float,
    work: FilterWork,
) -> float:  # fmt: skip
    """Correct in place by the measurement, and return the log-likelihood, nan if it fails.

    ``innovation`` is written, and the lower Cholesky factor of its covariance S to ``work``;
    ``variances`` and ``weight`` are those of `kalman.correct`.
    """
    functions = model.functions
    work.cause[0] = 0
    noise_of_row(model.R[min(k, len(model.R) - 1)], variances, work.linear)
    # x = x + K e, P = (I - K C) P (I - K C)' + K R K', or P - K S K' of sigma points
    log_likelihood = math.nan
    if extended is not None:
        log_likelihood = correct_extended(
            functions, y, u, mean, covariance, innovation, weight, work
        )
    if weights is not None:
        log_likelihood = correct_unscented(
            functions, weights, y, u, mean, covariance, innovation, weight, work
        )
    total = log_likelihood
    for a in range(len(work.linear.states)):
        total += mean[a] + covariance[a, a]
    if work.cause[0] == 0 and below_zero(covariance, work.linear):
        vague = is_vague(innovation, work.linear)
        if vague or extended is None:
            work.cause[0] = NEGATIVE if vague else NO_ROOT
            return math.nan
        clip_variances(covariance, work.linear)
    if math.isfinite(total):
        return log_likelihood
    if work.cause[0] == 0:
        work.cause[0] = NO_POSTERIOR if math.isfinite(log_likelihood) else NO_INNOVATION
    return math.nan


def parts_of(model: NonlinearModel, given: Mapping[str, Any], periods: Array) -> NDArray[np.int64]:
    """The number of predictions, of a sampling period at most, that lead to each row."""
    if not model.continuous:
        problem = "can only be given for a model of a differential equation, by from_ode"
        raise InputError("dt", problem)
    if model.density is None and "Q" not in given:
        raise InputError(
            "Q", "is the covariance of one sampling period; for other periods give "
            "from_ode the density of the noise, or Q by row",
        )  # fmt: skip
    counts = np.ceil(periods / model.sampling_period - LONGER)
    if counts.max() > MOST_PARTS:
        raise InputError(
            "dt", f"of {periods.max():g} s between two rows is {counts.max():g} sampling periods, "
            f"must be {MOST_PARTS} or fewer, as each is predicted",
        )  # fmt: skip
    return np.maximum(counts, 1).astype(np.int64)


def by_row(
    model: NonlinearModel,
    given: Mapping[str, Any],
    rows: int,
    held: Mapping[str, Array],
    periods: Array | None,
) -> tuple[dict[str, Any], Array]:
    """Q, R and the steps of a record of k rows, and values of the parameters behind its inputs.

    ``given`` are Q, R and parameters by name, ``held`` those that lead to the first row, where they
    are not the model's. ``periods`` [s] lead to each row, (k + 1,), from the one before the record
    on; None where all are the sampling period.
    """
    fields: dict[str, Any] = {"Q": for_loop(model.Q)[None], "R": for_loop(model.R)[None]}
    fields["steps"], fields["parts"] = model.steps, np.ones((1, 2), np.int64)
    values = model.parameter_values[None]
    if periods is not None:
        parts = parts_of(model, given, periods)
        fields["steps"] = periods / (model.substeps * parts)
        fields["parts"] = np.stack([parts, parts], axis=1)
        if model.density is not None:
            fields["Q"] = model.density * (periods / parts)[:, None, None]
        # What is given is the noise of the whole time to a row.
        if "Q" in held:
            fields["parts"][0, 1] = 1
        if "Q" in given:
            fields["parts"][1:, 1] = 1
    if "R" in given:
        fields["R"] = as_covariances("R", given["R"], model.outputs, rows)
    first = held["Q"][None] if "Q" in held else fields["Q"][:1]
    if "Q" in given:
        read = as_covariances("Q", given["Q"], model.states, rows)
        fields["Q"] = np.concatenate([first, read])
    elif "Q" in held:
        fields["Q"] = np.concatenate([first, fields["Q"][0 if periods is None else 1 :]])
    if "parameters" in given or "parameters" in held:
        read = values_by_row(model.parameters, given.get("parameters", {}), rows)
        before = held.get("parameters", model.parameter_values)
        later = np.broadcast_to(read, (rows, read.shape[1]))
        values = np.concatenate([before[None], later])
    return fields, values


def nonlinear_in_record(
    filter: Any,  # noqa: A002
    given: Mapping[str, Any],
    y: Array,
    inputs: Array,
    held: Mapping[str, Array],
    periods: Array | None,
) -> InRecord:
    """The noise and steps of each row, and inputs with the parameters behind them."""
    fields, values = by_row(filter.model, given, len(y), held, periods)
    after = {}
    if "Q" in given:
        after["Q"] = fields["Q"][-1]
    if "parameters" in given:
        after["parameters"] = values[-1]
    if "dt" in given and periods is not None:
        after["dt"] = periods[-1:]
    correlation = correlation_of(
        given.get("S"), fields["Q"], fields["R"], len(y), held,
        open_end=periods is not None and "Q" not in given,
    )  # fmt: skip
    if correlation is not None and fields["parts"].max() > 1:
        problem = "must be left out where rows are more than a sampling period apart: its noise is"
        raise InputError("S", f"{problem} of one prediction")
    if values.size:
        inputs = side_by_side(inputs, values)
    rows = NonlinearRows(filter.functions, **fields, correlation=correlation)
    return InRecord(rows, inputs, after)


@kernel
def run_nonlinear(
    model: NonlinearRows,
    method: Approximation,
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
        ends[r, 0] = ends[r, 1] = 0
        first = ends[r, 0]  # a literal 0 would have the rows compiled for it, too
        while first < count and ends[r, 0] == first:
            if r * count + first >= due:
                due = poll(r * count + first)
            last = min(count, due - r * count)
            # x(k|k-1), P(k|k-1), then x(k|k), P(k|k)
            _run_rows(
                model, model.correlation, method.weights, method.extended, measurements, inputs,
                fresh, posteriors, rows, kept, work, ends, r, first, last,
            )  # fmt: skip
            first = last


@inlined_kernel
def _run_rows(
    model: NonlinearRows, correlation: Correlation | None, weights: Weights | None,
    extended: bool | None, measurements: Array, inputs: Array, fresh: bool,
    posteriors: FilterPosteriors, rows: FilterRows, kept: PredictedRows | None, work: FilterWork,
    ends: NDArray[np.int64], r: int, first: int, last: int,
) -> None:  # fmt: skip
    """Filter the rows of a record from ``first`` to before ``last``."""
    mean, covariance = posteriors.means[r], posteriors.covariances[r]
    for k in range(first, last):
        y, innovation = measurements[r, k], rows.innovation[r, k]
        # x = f(x, u), P = A P A' + Q, or that of sigma points
        if (k > 0 or not fresh) and not predict(
            model, correlation, weights, extended, k, inputs[r, k], mean, covariance, mean,
            covariance, work,
        ):  # fmt: skip
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
                model, weights, extended, k, y, inputs[r, k + 1], mean, covariance, innovation,
                posteriors.noises[r],
                weight_of_row(posteriors.counts[r] + k, work.linear.rules.forgetting), work,
            )  # fmt: skip
            if math.isnan(rows.log_likelihood[r, k]):
                ends[r, 1] = work.cause[0]
                break
            if kept is not None:
                assign_matrix(kept.gain[r, k], work.linear.gain)
        keep_row(mean, covariance, innovation, work.linear, rows, r, k)
        if correlation is not None and len(correlation.S) > 0:
            take_out_extended(
                model.functions, correlation, k, model.R[min(k, len(model.R) - 1)],
                posteriors.noises[r], y, inputs[r, k + 1], mean, covariance, innovation, work,
            )  # fmt: skip
        keep_noise(posteriors, not missing, rows, r, k, work.linear)
        ends[r, 0] = k + 1


@kernel
def predict_nonlinear(
    model: NonlinearRows, method: Approximation, inputs: Array, means: Array, covariances: Array,
    next_means: Array, next_covariances: Array, crosses: Array, work: FilterWork,
    transitions: Array | None = None,
) -> int:  # fmt: skip
    """Predict from each row to the next one, and return how many rows could be.

    ``crosses`` become the cross-covariances of x(k) and x(k+1), shape (k, n, n), and
    ``transitions`` df/dx of the extended filter, if they are not None.
    """
    due = FIRST
    for k in range(len(next_means)):
        if k >= due:
            due = poll(k)
        # x(k+1|k), P(k+1|k), cov(x(k), x(k+1))
        if not predict(
            model, model.correlation, method.weights, method.extended, k + 1, inputs[k + 1],
            means[k], covariances[k], next_means[k], next_covariances[k], work,
        ):  # fmt: skip
            return k
        for a in range(len(work.cross)):
            assign(crosses[k, a], work.cross[a])
        if transitions is not None:
            assign_matrix(transitions[k], work.flow.A)
    return len(next_means)


NONLINEAR = FilterSteps(
    NonlinearModel, nonlinear_in_record, run_nonlinear, predict_nonlinear, new_filter_work, CAUSES
)
TAKES = ("Q", "R", "parameters", "dt", "keep")


@dataclass(frozen=True, eq=False, repr=False)
class NonlinearFilter(GaussianFilter):
    """Base class of filters on nonlinear models."""

    steps: ClassVar[FilterSteps] = NONLINEAR
    has_kalman_gain: ClassVar[bool] = True
    takes: ClassVar[tuple[str, ...]] = TAKES

    def step(
        self, start: KalmanState, y: Sample, u: Sample | None = None, *,
        time: float | None = None, Q: ArrayLike | None = None, R: ArrayLike | None = None,
        S: ArrayLike | None = None, parameters: Mapping[str, ArrayLike] | None = None,
        dt: float | None = None, keep: str | Sequence[str] | None = None,
    ) -> tuple[KalmanState, Estimate]:  # fmt: skip
        """Take one row: the start of the next one, and the estimates at it.

        Stepping through a record gives bitwise what `run` gives.

        Parameters
        ----------
        start
            From `init`, or from the row before.
        y, u, time, Q, R, S, parameters, dt, keep
            As those of `run`, without the axis of rows. Of y and u also numbers by name, of
            which measurements may be left out.

        Raises
        ------
        InputError
            As `run`.
        DivergenceError
            As `run`.
        """
        given = {"Q": Q, "R": R, "S": S, "parameters": parameters, "dt": dt, "keep": keep}
        return self._step_given(start, y, u, time, given)

    def run(
        self, y: ArrayLike, u: ArrayLike | None = None, *, start: KalmanState | None = None,
        time: ArrayLike | None = None, Q: ArrayLike | None = None, R: ArrayLike | None = None,
        S: ArrayLike | None = None, parameters: Mapping[str, ArrayLike] | None = None,
        dt: ArrayLike | None = None, keep: str | Sequence[str] | None = None,
        on_divergence: OnDivergence = "raise",
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
            from `from_ode` with a density of the noise any that rise, but with a ``noise_memory``,
            else a sampling period apart.
        Q, R
            In place of the model's, for this record: one for all rows, or one for each, (k, ., .).
            Q of row k leads from row k to row k + 1.
        S
            E[w v'], as `KalmanFilter.run` has it, of an extended filter, whose prediction becomes
            f(x, u) + J e(k|k), with J = S R^-1. Rows are then a sampling period apart or less.
        parameters
            Values of the model's parameters by name, numbers or (k,).
        dt
            In place of ``time``: the time [s] from each row to the next one, a number or (k,), of a
            model from `from_ode`. More than a sampling period is predicted in equal parts, and Q by
            row is added in the last of them.
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
        >>> from reobserve import ExtendedKalmanFilter, NonlinearModel
        >>> pendulum = NonlinearModel.from_ode(
        ...     ["rate", "-g*sin(angle)"], ["angle"], Q=1e-6, R=1e-4, parameters={"g": 9.81},
        ...     state_names=["angle", "rate"], sampling_period=0.1,
        ... )
        >>> observer = ExtendedKalmanFilter(pendulum)
        >>> start = observer.init([0.3, 0.0], 0.01)
        >>> run = observer.run([0.3, 0.285, 0.243], start=start, parameters={"g": 9.0})
        >>> print(run["state_angle"][-1].round(3))
        0.244
        """
        given = {"Q": Q, "R": R, "S": S, "parameters": parameters, "dt": dt, "keep": keep}
        return self._run_given(y, u, start, time, on_divergence, given)


@dataclass(frozen=True, eq=False, repr=False)
class ExtendedKalmanFilter(NonlinearFilter):
    """Extended Kalman filter: Kalman's on the model linearised about each estimate.

        x = f(x, u),              P = A P A' + Q                           A = df/dx
        S = C P C' + R,           K = P C' S^-1                            C = dh/dx
        x = x + K (y - h(x, u)),  P = (I - K C) P (I - K C)' + K R K'

    Jazwinski 1970, Stochastic Processes and Filtering Theory, theorem 8.1. `init` takes mean and
    covariance; `run` and `step` take y, shape (k, m), nan where missing, and u, (k, p), and by name
    Q, R, ``parameters``, ``dt`` and ``keep``, see `run`. Estimates, in units of the
    model: ``state``, x, shape (k, n), ``covariance``, P, (k, n, n), and its diagonal ``variance``,
    (k, n); ``innovation``, y - h(x, u), (k, m), ``innovation_covariance``, S, (k, m, m), and
    ``log_likelihood``, (k,).

    Parameters
    ----------
    model
        The nonlinear model of the plant; its Jacobians are given there, derived from text, or
        found by differences.
    gate, outliers, noise_memory
        As those of `KalmanFilter`.

    Raises
    ------
    InputError
        If the model is of another kind.

    Examples
    --------
    >>> from reobserve import ExtendedKalmanFilter, NonlinearModel
    >>> pendulum = NonlinearModel.from_ode(
    ...     ["rate", "-9.81*sin(angle)"], ["angle"], Q=1e-6, R=1e-4,
    ...     state_names=["angle", "rate"], sampling_period=0.1,
    ... )
    >>> observer = ExtendedKalmanFilter(pendulum)
    >>> run = observer.run([0.3, 0.285, 0.243, 0.178, 0.095, 0.003], start=observer.init([0, 0], 1))
    >>> print(run["state_rate"][-1].round(2))
    -0.94
    """

    model: NonlinearModel

    method = Approximation(None, extended=True)
    takes: ClassVar[tuple[str, ...]] = (*TAKES, "S")

    @property
    def functions(self) -> Functions:
        """The model's functions, with Jacobians."""
        return self.model.functions


@dataclass(frozen=True, eq=False, repr=False)
class UnscentedKalmanFilter(NonlinearFilter):
    """Unscented Kalman filter with scaled sigma points, without Jacobians.

        X_0 = x,   X_i = x + c L_i,   X_(n+i) = x - c L_i,   P = L L',   c^2 = n + lambda
        lambda = alpha^2 (n + kappa) - n
        x = sum w_i f(X_i),   P = sum v_i (f(X_i) - x) (f(X_i) - x)' + Q

    The weights of all points but the first are 1 / (2 c^2); those of the first are lambda / c^2 in
    means and lambda / c^2 + 1 - alpha^2 + beta in covariances (Wan & van der Merwe 2000). The
    points are placed again after the prediction, and L is the lower Cholesky factor, as in
    filterpy.

    `init` takes mean and covariance; `run` and `step` take y, shape (k, m), nan where missing, and
    u, (k, p), and by name what `ExtendedKalmanFilter` takes. Estimates, in units of the model:
    ``state``, x, shape (k, n), ``covariance``, P, (k, n, n), and its diagonal ``variance``, (k, n);
    ``innovation``, (k, m), ``innovation_covariance``, (k, m, m), and ``log_likelihood``, (k,).

    Parameters
    ----------
    model
        The nonlinear model of the plant.
    alpha
        How far the points are spread, from above 0 to 1. Wan & van der Merwe name 0.001; filterpy's
        ``MerweScaledSigmaPoints`` has no default and uses 0.1 in its examples. Weights grow as
        1 / alpha^2, and so do rounding errors.
    beta
        Knowledge of the distribution's tails; 2 is best for a Gaussian one.
    kappa
        Second spread, above -n; 0 as in Wan & van der Merwe. filterpy's documentation names 3 - n.
    gate, outliers, noise_memory
        As those of `KalmanFilter`.

    Raises
    ------
    InputError
        If ``alpha`` is not above 0 and up to 1, or n + ``kappa`` is not above 0.

    Examples
    --------
    >>> from reobserve import NonlinearModel, UnscentedKalmanFilter
    >>> pendulum = NonlinearModel.from_ode(
    ...     ["rate", "-9.81*sin(angle)"], ["angle"], Q=1e-6, R=1e-4,
    ...     state_names=["angle", "rate"], sampling_period=0.1,
    ... )
    >>> observer = UnscentedKalmanFilter(pendulum)
    >>> run = observer.run([0.3, 0.285, 0.243, 0.178, 0.095, 0.003], start=observer.init([0, 0], 1))
    >>> print(run["state_rate"][-1].round(2))
    -0.94
    """

    model: NonlinearModel
    _: KW_ONLY
    alpha: float = 0.1
    beta: float = 2.0
    kappa: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        alpha = as_positive("alpha", self.alpha)
        if not 1e-6 <= alpha <= 1:
            raise InputError("alpha", f"{alpha:g} must be from 1e-6 to 1")
        kappa = as_scalar("kappa", self.kappa)
        if self.model.states + kappa <= 0:
            raise InputError("kappa", f"{kappa:g} must be above -{self.model.states}, minus n")
        object.__setattr__(self, "alpha", alpha)
        object.__setattr__(self, "beta", as_scalar("beta", self.beta))
        object.__setattr__(self, "kappa", kappa)

    @property
    def functions(self) -> Functions:
        """The model's functions, without Jacobians."""
        return self.model.functions_alone

    @cached_property
    def method(self) -> Approximation:
        """The weights of the sigma points, and no extended filter."""
        return Approximation(self.weights, None)

    @cached_property
    def weights(self) -> Weights:
        """The weights of the sigma points."""
        n, alpha_squared = self.model.states, self.alpha**2
        square = alpha_squared * (n + self.kappa)
        first = (square - n) / square + 1.0 - alpha_squared + self.beta
        return Weights(math.sqrt(square), 0.5 / square, first)
