"""Compiled steps of the extended Kalman filter."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from reobserve.core.direct_call import call
from reobserve.core.kernel import inlined_kernel
from reobserve.observers.linear_filter_loop import (
    Size,
    correct_covariance,
    kalman_gain,
    log_likelihood_of,
)
from reobserve.observers.nonlinear_filter_work import FilterWork, correct_mean, innovate
from reobserve.systems.linear import ModelArrays
from reobserve.systems.nonlinear_flow import Functions, jacobian, move_and_derive

Array = NDArray[np.float64]


@inlined_kernel
def predict_extended(
    states: Size, functions: Functions, Q: Array, u: Array, mean: Array, covariance: Array,
    next_covariance: Array, work: FilterWork,
) -> None:  # fmt: skip
    """Write f(x, u) to ``work.moved``, the covariance, and cov(x(k), x(k+1)) to ``work.cross``."""
    n = len(states)
    move_and_derive(functions, mean, u, work.moved, work.flow)
    A, cross = work.flow.A, work.cross
    # cov(x(k), x(k+1)) = P A'
    for a in range(n):
        for b in range(n):
            total = 0.0
            for i in range(n):
                total += covariance[a, i] * A[b, i]
            cross[a, b] = total
    # P = A P A' + Q
    for a in range(n):
        for b in range(a + 1):
            total = Q[a, b]
            for i in range(n):
                total += A[a, i] * cross[i, b]
            next_covariance[a, b] = total
            next_covariance[b, a] = total


@inlined_kernel
def correct_extended(
    states: Size, outputs: Size, functions: Functions, R: Array, y: Array, u: Array, mean: Array,
    covariance: Array, innovation: Array, factor: Array, work: FilterWork,
) -> float:  # fmt: skip
    """Measurement update in place; return the log-likelihood, nan if it fails.

    ``innovation`` and ``factor`` are written: e and the lower Cholesky factor of its covariance S.
    """
    n, m = len(states), len(outputs)
    linear, flow = work.linear, work.flow
    # C = dh/dx
    jacobian(
        functions.h, functions.H, functions.H_given, functions.scale, mean, u, flow.C_flat, flow
    )
    expected = flow.values[0, :m]
    call(functions.h, (mean, u, expected))
    if not innovate(y, expected, innovation, work):
        return math.nan
    model = ModelArrays(flow.A, work.none[:n], flow.C, work.none[:m], flow.stage, R)
    # S = C P C' + R
    log_likelihood = log_likelihood_of(
        states, outputs, model, covariance, innovation, factor, linear
    )
    # K = P C' S^-1
    kalman_gain(outputs, factor, linear)
    # x = x + K e
    correct_mean(mean, innovation, linear.gain)
    # P = (I - K C) P (I - K C)' + K R K'
    correct_covariance(states, outputs, model, covariance, linear)
    return log_likelihood
