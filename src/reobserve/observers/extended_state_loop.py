"""Compiled loop of the extended state observer: one matrix times what is known, a step."""

from __future__ import annotations

from collections.abc import Sized

import numpy as np
from numpy.typing import NDArray

from reobserve.core.interrupts import FIRST, poll
from reobserve.core.kernel import allocating_kernel, inlined_kernel
from reobserve.observers.fixed_step import Samples

Array = NDArray[np.float64]

_UNROLLED = 16  # states: more are faster in vector instructions over a plain loop


def run_observer(weights: Array, start: Array, y: Samples, u: Samples, rows: Array) -> int:
    """Fill the rows of states, the first of which is ``start``, and return how many are finite.

    Parameters
    ----------
    weights
        The next state, shape (states,), is known @ weights, with the state, then y and u at the
        start, at the end and in the middle of a step.
    start
        The state at the start of the first step.
    y, u
        At the ends and in the middle of each step.
    rows
        Where the states go, shape (steps + 1, states).
    """
    states = rows.shape[1]
    # The compiler knows the length of a tuple, and unrolls the loops over it.
    size: Sized = (0,) * states if states <= _UNROLLED else np.empty(states)
    known = np.zeros(len(weights))
    known[:states] = rows[0] = start
    return _run(size, weights, known, y, u, rows)


@inlined_kernel
def _take(y: Array, u: Array, k: int, known: Array) -> None:
    """Write row k of y and u to the start of ``known``."""
    p = y.shape[1]
    for i in range(p):
        known[i] = y[k, i]
    for i in range(u.shape[1]):
        known[p + i] = u[k, i]


@allocating_kernel
def _run(size: Sized, weights: Array, known: Array, y: Samples, u: Samples, rows: Array) -> int:
    """Fill ``rows`` after the first, and return the number of finite rows."""
    n, columns = len(size), y.right.shape[1] + u.right.shape[1]
    after = np.empty(n)
    due = FIRST
    for k in range(1, len(rows)):
        if k >= due:
            due = poll(k)
        _take(y.right, u.right, 2 * k - 2, known[n:])
        _take(y.left, u.left, 2 * k, known[n + columns :])
        _take(y.right, u.right, 2 * k - 1, known[n + 2 * columns :])
        # x(k) = known @ weights, known = [x(k-1), y and u at the start, the end and in the middle]
        for i in range(n):
            after[i] = 0.0
        for j in range(len(weights)):
            for i in range(n):
                after[i] += weights[j, i] * known[j]
        total = 0.0
        for i in range(n):
            rows[k, i] = known[i] = after[i]
            total += after[i]
        if not np.isfinite(total):
            return k
    return len(rows)
