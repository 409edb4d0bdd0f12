"""Compiled loop of the extended state observer: one matrix times what is known, a sample."""

from __future__ import annotations

from collections.abc import Sequence, Sized
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import InputError, shown
from reobserve.numerics.kernel import inlined_kernel, kernel
from reobserve.numerics.matrices import as_samples

Array = NDArray[np.float64]
Pair = tuple[ArrayLike, ArrayLike]

_UNROLLED = 16  # states: more are faster in vector instructions over a plain loop


class Samples(NamedTuple):
    """y, shape (k, p), and u, shape (k, m)."""

    output: Array
    control: Array


def read_pair(name: str, pair: Pair, columns: tuple[int, int], rows: int | None = None) -> Samples:
    """Finite samples of y and u; as many as of y if not said.

    Raises
    ------
    InputError
        If they are not; ``name`` goes before output or control.
    """
    if not isinstance(pair, tuple | list) or len(pair) != 2:
        raise InputError(name.strip(), f"{shown(pair)} must be a pair of y and u")
    output = as_samples(f"{name}output", pair[0], columns[0], rows=rows, like="output")
    known = as_samples(
        f"{name}control", pair[1], columns[1], rows=len(output), like=f"{name}output"
    )
    return Samples(output, known)


def run_observer(
    weights: Array, start: Array, held: Sequence[Samples], rows: Array, fresh: bool
) -> int:
    """Fill the rows of states from ``start`` on; return the number of finite rows.

    Parameters
    ----------
    weights
        The next state, shape (states,), is known @ weights, with the state, then y and u at each of
        the places between two samples that the hold needs.
    start
        The state, and y and u, at the sample before the first.
    held
        y and u at the samples, then at the end of each step and in its middle as the hold needs it.
    rows
        Where the states go, shape (k, states).
    fresh
        There is no sample before the first: the state is meant at that.
    """
    states = rows.shape[1]
    known = np.zeros(len(weights))
    known[: len(start)] = start
    first = int(fresh)
    if fresh:
        rows[0] = known[:states]
        _take(held[0], 0, known[states:])
    # The compiler knows the length of a tuple, and unrolls the loops over it.
    size: Sized = (0,) * states if states <= _UNROLLED else np.empty(states)
    return _run(size, weights, known, tuple(held), rows, first)


@inlined_kernel
def _take(samples: Samples, k: int, known: Array) -> None:
    """Write y and u of one sample to the start of ``known``."""
    p = samples.output.shape[1]
    for i in range(p):
        known[i] = samples.output[k, i]
    for i in range(samples.control.shape[1]):
        known[p + i] = samples.control[k, i]


@kernel
def _run(
    states: Sized, weights: Array, known: Array, held: tuple[Samples, ...], rows: Array, first: int
) -> int:
    """Fill ``rows`` from ``first`` on; return the number of finite rows."""
    n, p, m = len(states), held[0].output.shape[1], held[0].control.shape[1]
    after = np.empty(n)
    for k in range(first, len(rows)):
        for j in range(1, len(held)):
            _take(held[j], k, known[n + j * (p + m) :])
        after[:] = 0.0
        for j in range(len(weights)):
            for i in range(n):
                after[i] += weights[j, i] * known[j]
        total = 0.0
        for i in range(n):
            rows[k, i] = known[i] = after[i]
            total += after[i]
        if not np.isfinite(total):
            return k
        _take(held[0], k, known[n:])
    return len(rows)
