"""Compiled steps of the extended Kalman filter."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.direct_call import call
from reobserve.core.kernel import inlined_kernel
from reobserve.observers.filter_rules import learn_noise
from reobserve.observers.linear_steps import (
    correct_covariance,
    correct_mean,
    kalman_gain,
    log_likelihood_of,
)
from reobserve.observers.nonlinear_filter_work import FilterWork, innovate
from reobserve.systems.nonlinear_flow import Functions, jacobian, move_and_derive, write_sizes

Array = NDArray[np.float64]


@inlined_kernel
def predict_extended(
    functions: Functions, steps: Any, k: int, Q: Array, u: Array, mean: Array, covariance: Array,
    next_covariance: Array, work: FilterWork,
) -> None:  # fmt: skip
    """Write f(x, u) to ``work.moved``, the covariance, and cov(x(k-1), x(k)) to ``work.cross``."""
    n = len(work.linear.states)
    # x = f(x, u), A = df/dx
    write_sizes(functions.F, functions.scale, mean, covariance, work.flow.sizes)
    move_and_derive(functions, steps, k, mean, u, work.moved, work.flow)
    A, cross = work.flow.A, work.cross
    # cov(x(k-1), x(k)) = P A'
    for a in range(n):
        for b in range(n):
            total = 0.0
            for i in range(n):
                total += covariance[a, i] * A[b, i]
            cross[a, b] = total
    # P = A (P A') + Q
    for a in range(n):
        for b in range(a + 1):
            total = Q[a, b]
            for i in range(n):
                total += A[a, i] * cross[i, b]
            next_covariance[a, b] = total
            next_covariance[b, a] = total


@inlined_kernel
def extend_cross(work: FilterWork) -> None:
    """Write cov(x, x(k)) = cov(x, x(k-1)) A' to ``work.cross``, from ``work.before``."""
    n = len(work.before)
    for a in range(n):
        for b in range(n):
            total = 0.0
            for i in range(n):
                total += work.before[a, i] * work.flow.A[b, i]
            work.cross[a, b] = total


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
    write_sizes(functions.H, functions.scale, mean, covariance, flow.sizes)
    jacobian(functions.h, functions.H, mean, u, flow.C_flat, flow)
    # e = y - h(x, u)
    expected = flow.values[0, : len(y)]
    call(functions.h, (mean, u, expected))
    if not innovate(y, expected, innovation, work):
        return math.nan
    # S = C P C' + R
    log_likelihood = log_likelihood_of(flow.C, covariance, innovation, linear)
    if linear.rules.forgetting > 0.0:
        learn_noise(innovation, weight, linear)
    # K = P C' S^-1
    kalman_gain(linear)
    # x = x + K e
    correct_mean(mean, innovation, linear)
    # P = (I - K C) P (I - K C)' + K R K'
    correct_covariance(flow.C, covariance, linear)
    return log_likelihood
