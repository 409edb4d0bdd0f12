"""Compiled steps of the unscented Kalman filter."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.direct_call import call
from reobserve.core.kernel import inlined_kernel
from reobserve.observers.filter_rules import gate, learn_noise, shortest
from reobserve.observers.linear_steps import assign, correct_mean, factor_innovation, kalman_gain
from reobserve.observers.nonlinear_filter_work import NO_ROOT, FilterWork, innovate
from reobserve.systems.nonlinear_flow import Functions, move

Array = NDArray[np.float64]

ROUNDING = 1e-12  # of a variance: how far below zero a pivot may be


class Weights(NamedTuple):
    """Weights of scaled sigma points (Wan & van der Merwe 2000).

    The points are x and x +- ``spread`` times the columns of a root of P. ``each`` is the weight of
    all but the first one, of which ``first`` is that in covariances.
    """

    spread: float
    each: float
    first: float


@inlined_kernel
def take_root(covariance: Array, root: Array) -> bool:
    """Write the lower Cholesky factor L of P = L L', or return False for a negative eigenvalue.

    Where P is singular a column of L is zero.
    """
    n = len(covariance)
    for j in range(n):
        for i in range(j):
            root[i, j] = 0.0
        pivot = covariance[j, j]
        for i in range(j):
            pivot -= root[j, i] * root[j, i]
        bound = ROUNDING * covariance[j, j]
        if not pivot >= -bound:  # nan, too
            return False
        singular = pivot <= 1e-4 * bound
        root[j, j] = 0.0 if singular else math.sqrt(pivot)
        for k in range(j + 1, n):
            total = covariance[k, j]
            for i in range(j):
                total -= root[k, i] * root[j, i]
            root[k, j] = 0.0 if singular else total / root[j, j]
    return True


@inlined_kernel
def place_points(mean: Array, covariance: Array, weights: Weights, work: FilterWork) -> bool:
    """Write the sigma points x, x + c L_i, x - c L_i, or return False if P has no root."""
    n = len(work.linear.states)
    if not take_root(covariance, work.root):
        work.cause[0] = NO_ROOT
        return False
    for a in range(n):
        work.points[0, a] = mean[a]
        for i in range(n):
            offset = weights.spread * work.root[a, i]
            work.points[1 + i, a] = mean[a] + offset
            work.points[1 + n + i, a] = mean[a] - offset
    return True


@inlined_kernel
def average_points(images: Array, weight: float, periods: Array, mean: Array) -> None:
    """Write the mean, as the first point plus what the others differ from it by.

    All weights sum to one; so written, a large negative one does not cancel, and angles differ the
    shortest way round.
    """
    for a in range(len(mean)):
        total = 0.0
        for i in range(1, len(images)):
            total += shortest(images[i, a] - images[0, a], periods[a])
        mean[a] = images[0, a] + weight * total


@inlined_kernel
def spread_of(images: Array, weights: Weights, noise: Array, out: Array) -> None:
    """Write the lower half of sum w d d' + noise, where d are rows of ``images``."""
    for a in range(len(noise)):
        for b in range(a + 1):
            total = 0.0
            for i in range(1, len(images)):
                total += images[i, a] * images[i, b]
            central = weights.first * images[0, a] * images[0, b]
            out[a, b] = noise[a, b] + central + weights.each * total


@inlined_kernel
def cross_of(root: Array, images: Array, weights: Weights, cross: Array) -> None:
    """Write sum w (X - x) d', where d are rows of ``images`` and X - x is 0, c L_i or -c L_i."""
    n = len(root)
    for a in range(n):
        for b in range(cross.shape[1]):
            total = 0.0
            for i in range(n):
                total += root[a, i] * (images[1 + i, b] - images[1 + n + i, b])
            cross[a, b] = weights.each * weights.spread * total


@inlined_kernel
def subtract(rows: Array, mean: Array, periods: Array) -> None:
    """Subtract a mean from each row, angles the shortest way round."""
    for i in range(len(rows)):
        for a in range(len(mean)):
            rows[i, a] = shortest(rows[i, a] - mean[a], periods[a])


@inlined_kernel
def predict_unscented(
    functions: Functions, weights: Weights, steps: Any, k: int, Q: Array, u: Array, mean: Array,
    covariance: Array, next_covariance: Array, work: FilterWork,
) -> bool:  # fmt: skip
    """Write x(k) to ``work.moved``, its covariance, and cov(x(k-1), x(k)) to ``work.cross``.

    False if P has no root.
    """
    n = len(work.linear.states)
    # X = x, x + c L_i, x - c L_i
    if not place_points(mean, covariance, weights, work):
        return False
    images = work.images[:, :n]
    for i in range(2 * n + 1):
        move(functions, steps, k, work.points[i], u, work.moved, work.flow)
        assign(images[i], work.moved)
    # x = sum w f(X), P = sum w (f(X) - x) (f(X) - x)' + Q
    periods = work.linear.rules.state_periods
    average_points(images, weights.each, periods, work.moved)
    subtract(images, work.moved, periods)
    cross_of(work.root, images, weights, work.cross)
    spread_of(images, weights, Q, next_covariance)
    for a in range(n):
        for b in range(a):
            next_covariance[b, a] = next_covariance[a, b]
    return True


@inlined_kernel
def extend_cross_by_root(work: FilterWork) -> None:
    """Write cov(x, x(k)) = cov(x, x(k-1)) P^-1 cov(x(k-1), x(k)) to ``work.cross``.

    The first is ``work.before``, the last ``work.cross``, and P = L L' that of x(k-1).
    """
    before, column, n = work.before, work.flow.point, len(work.before)
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
def solve_by_root(root: Array, cross: Array, gain: Array) -> None:
    """Solve G L L' = C: G L first, then G. C and G may be the same array.

    Where P = L L' is singular C is, too, and G is zero there.
    """
    n = len(root)
    for a in range(n):
        for i in range(n):
            total = cross[a, i]
            for j in range(i):
                total -= root[i, j] * gain[a, j]
            gain[a, i] = total / root[i, i] if root[i, i] > 0.0 else 0.0
        for last in range(n):
            i = n - 1 - last
            total = gain[a, i]
            for j in range(i + 1, n):
                total -= root[j, i] * gain[a, j]
            gain[a, i] = total / root[i, i] if root[i, i] > 0.0 else 0.0


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
    # y = sum w h(X)
    periods, R = linear.rules.output_periods, linear.noise
    average_points(images, weights.each, periods, expected)
    if not innovate(y, expected, innovation, work):
        return math.nan
    # S = sum w (h(X) - y) (h(X) - y)' + R
    subtract(images, expected, periods)
    spread_of(images, weights, R, linear.factor)
    gate(innovation, linear)
    log_likelihood = factor_innovation(innovation, linear.factor, linear)
    if linear.rules.forgetting > 0.0:
        learn_noise(innovation, weight, linear)
    # K = sum w (X - x) (h(X) - y)' S^-1
    cross_of(work.root, images, weights, linear.cross)
    kalman_gain(linear)
    # x = x + K e
    for i in range(len(points)):
        for a in range(n):
            points[i, a] -= mean[a]
    correct_mean(mean, innovation, linear)
    # P = sum w r r' + K R K'
    spread_after(R, weights, linear.gain, points, images, covariance)
    return log_likelihood


@inlined_kernel
def spread_after(
    R: Array, weights: Weights, gain: Array, points: Array, images: Array, covariance: Array
) -> None:
    """The covariance of sigma points in Joseph's form, with r = (X - x) - K (h(X) - y).

    P = sum w r r' + K R K', which is P - K S K' but for rounding.
    """
    n, m = gain.shape
    for i in range(len(points)):
        for a in range(n):
            for o in range(m):
                points[i, a] -= gain[a, o] * images[i, o]
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
