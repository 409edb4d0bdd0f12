"""Derivatives of a signal that comes without them, from its samples so far.

An observer that needs a signal and its derivatives up to the order n takes rows of all n + 1, from
those who have them, or of the signal alone. Then it takes the derivatives, at each sample, of the
polynomial through that sample and the n + 1 before it; at the start, as long as there are fewer,
through those that there are, and from the first to the second sample the derivatives are those of
the second. For a smooth signal and the sampling period h the derivative of order
i is off by h^(n + 2 - i) times a constant. Noise is amplified: of the size e on the samples, it is
of the size e / h^i and more on the derivatives, 2.5 e / h on u' for n = 1.
"""

from __future__ import annotations

from functools import cache
from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError
from reobserve.core.kernel import kernel
from reobserve.core.matrices import as_numbers, as_sample_rows

Array = NDArray[np.float64]


def as_signal_rows(name: str, value: ArrayLike, order: int, *, rows: int | None = None) -> Array:
    """A record of a signal and its derivatives, shape (k, order + 1), or alone, shape (k, 1).

    Raises
    ------
    InputError
        If it has another number of columns or of rows, or is not finite.
    """
    columns = order + 1
    try:
        shape = as_numbers(name, value).shape
    except InputError:
        shape = ()  # `as_sample_rows` says it
    if len(shape) == 2 and shape[1] not in (1, columns):
        raise InputError(
            name,
            f"has shape {shape}, must have {columns} columns, a signal and its derivatives up to "
            f"the order {order}, or one, the signal alone",
        )
    alone = len(shape) != 2 or shape[1] == 1
    return as_sample_rows(name, value, 1 if alone else columns, rows=rows)


def completed(
    rows: Array,
    before: Array | None,
    middle: Array | None,
    *,
    recent: Array,
    known: int,
    last: Array | None,
    period: float,
) -> tuple[Array | None, Array, Array, Array | None]:
    """``last`` and a signal with its derivatives, its limits from the left, its middles.

    Where limits are given of the signal alone, its derivatives do not jump; where middles are,
    these take the mean of those beside them. Without limits the signal does not jump.

    Parameters
    ----------
    rows, before, middle
        As `as_signal_rows` gives them; shapes (k, n + 1) or (k, 1).
    recent, known
        The signal at the n + 1 samples before the rows, the latest last, shape (n + 1,), and how
        many of these were taken.
    last
        The completed row before the first, shape (n + 1,); None if there is none.
    period
        The sampling period [s].
    """
    full = rows
    if rows.shape[1] == 1:
        full = _with_derivatives(rows[:, 0], recent, known, period)
        # A first sample has none of its own; what it says of them is not read before the second.
        if last is not None and known == 1:
            last = np.concatenate([last[:1], full[0, 1:]])
        elif known == 0 and len(full) > 1:
            full[0, 1:] = full[1, 1:]
    if before is None:
        before = full
    elif before.shape[1] == 1:
        before = np.concatenate([before, full[:, 1:]], axis=1)
    if middle is not None and middle.shape[1] == 1:
        rates = rows_before(full, last)[:, 1:]
        middle = np.concatenate([middle, 0.5 * (rates + full[:, 1:])], axis=1)
    return last, full, before, middle


def rows_before(rows: Array, last: Array | None) -> Array:
    """Rows before each row. That of the first is ``last``, or itself if there is none."""
    return np.concatenate([rows[:1] if last is None else last[None], rows[:-1]])


def latest(recent: Array, values: Array) -> Array:
    """The latest samples after those of a record, as many as are remembered."""
    return np.concatenate([recent, values])[-len(recent) :]


def _with_derivatives(values: Array, recent: Array, known: int, period: float) -> Array:
    full = np.empty((len(values), len(recent)))
    full[:, 0] = values
    weights = scaled_weights(len(recent) - 1, period)
    write_derivatives(np.concatenate([recent, values]), known, weights, full)
    return full


@kernel
def write_derivatives(samples: Array, known: int, weights: Array, full: Array) -> None:
    """Write the derivatives of a signal behind it, shape (k, n + 1), at rows after ``known`` ones.

    ``samples`` are those of the n + 1 rows before, then those of the rows.
    """
    n = full.shape[1]
    for k in range(len(full)):
        points = min(known + 1 + k, n + 1)
        # u^(d)(t_k) = sum_i w_i u(t_k - i T)
        for d in range(1, n):
            total = 0.0
            for ago in range(points):
                total += samples[k + n - ago] * weights[points - 1, ago, d - 1]
            full[k, d] = total


@np.errstate(over="ignore", invalid="ignore")  # what is not finite diverges, and says so
def scaled_weights(order: int, period: float) -> Array:
    """Weights of samples, shape (n + 2, n + 2, n), for 1 to n + 2 points at a period [s]."""
    weights = np.zeros((order + 2, order + 2, order))
    for points in range(1, order + 3):
        scales = period ** np.arange(1.0, order + 1)
        weights[points - 1, :points] = derivative_weights(points, order) / scales
    return weights


@cache
def derivative_weights(points: int, order: int) -> Array:
    """Weights of the samples at 0, -1, ..., in the derivatives of their polynomial at 0.

    Shape (points, order), from the basis of Lagrange; all numbers up to the last division are
    whole.
    """
    places = -np.arange(float(points))
    weights = np.zeros((points, order))
    for i, place in enumerate(places):
        others = np.delete(places, i)
        basis = np.polynomial.polynomial.polyfromroots(others) / np.prod(place - others)
        for power in range(1, min(points, order + 1)):
            weights[i, power - 1] = factorial(power) * basis[power]
    return weights
