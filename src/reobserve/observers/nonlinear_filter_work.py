"""Scratch arrays of extended and unscented filters, and why their loops stop."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import inlined_kernel
from reobserve.observers.linear_filter_loop import LinearFilterWork
from reobserve.systems.nonlinear_flow import FlowWork, new_flow_work

Array = NDArray[np.float64]

# Why a filter stopped, see `nonlinear_filter.CAUSES`.
NO_STATE, NO_OUTPUT, NO_INNOVATION, NO_ROOT, NO_POSTERIOR = 1, 2, 3, 4, 5


class FilterWork(NamedTuple):
    """Scratch: that of the linear steps and of the model; sigma points and what becomes of them."""

    linear: LinearFilterWork
    flow: FlowWork
    moved: Array
    root: Array
    points: Array
    images: Array
    cross: Array
    none: Array
    cause: NDArray[np.int64]


def new_filter_work(states: int, outputs: int) -> FilterWork:
    """Scratch for the steps of a filter."""
    n, m, most = states, outputs, max(states, outputs)
    tall = (n, m)
    linear = LinearFilterWork(
        np.empty((n, n)), np.empty(n), np.empty(tall), np.empty(tall), np.empty(m)
    )
    return FilterWork(
        linear, new_flow_work(n, m), np.empty(n), np.empty((n, n)), np.empty((2 * n + 1, n)),
        np.empty((2 * n + 1, most)), np.empty((n, n)), np.empty((most, 0)), np.zeros(1, np.int64),
    )  # fmt: skip


@inlined_kernel
def innovate(y: Array, expected: Array, innovation: Array, work: FilterWork) -> bool:
    """Write y - h(x, u), nan where y is; false if h is not finite."""
    for o in range(len(y)):
        if not math.isfinite(expected[o]):
            work.cause[0] = NO_OUTPUT
            return False
        innovation[o] = y[o] - expected[o]
    return True


@inlined_kernel
def correct_mean(mean: Array, innovation: Array, gain: Array) -> None:
    """x = x + K e; columns of K that belong to missing outputs become zero."""
    for a in range(len(mean)):
        for o in range(len(innovation)):
            if math.isnan(innovation[o]):
                gain[a, o] = 0.0
            else:
                mean[a] += gain[a, o] * innovation[o]
