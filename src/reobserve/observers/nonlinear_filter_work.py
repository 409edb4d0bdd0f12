"""Scratch arrays of extended and unscented filters, and why their loops stop."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import inlined_kernel
from reobserve.observers.filter_rules import Rules, shortest
from reobserve.observers.linear_steps import LinearWork, blocks, new_linear_work
from reobserve.systems.nonlinear_flow import FlowWork, new_flow_work

Array = NDArray[np.float64]

# Why a filter stopped, see `nonlinear_filter.CAUSES`.
NO_STATE, NO_OUTPUT, NO_ROOT, NO_POSTERIOR = 1, 2, 4, 5  # beside NO_INNOVATION, 3


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
