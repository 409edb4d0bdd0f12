"""Tests of a filter's innovations for a change: Page's cumulative sum, and a likelihood ratio.

A test turns one number per sample into a statistic that stays low as long as the filter's model
holds. An alarm is raised where the statistic exceeds a threshold, which is set by the false alarms
on records without a fault. At a missing number (nan) the statistic keeps its value.

- `cusum` sums the log-likelihood ratios of two filters, one of the healthy and one of the faulty
  plant. It is the quickest test if both models are known (Page 1954; Lorden 1971).
- `inflated` marks samples at which innovations are too large for a probability of false alarms.
- `inflation_glr` needs the healthy model only. It detects innovations that have become larger by an
  unknown factor at an unknown time. It is a generalised likelihood ratio (Willsky & Jones 1976),
  here for the scale of a covariance, over windows of a few lengths only (Lai 1995).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_whole
from reobserve.core.chi_squared import inflated_rows
from reobserve.core.errors import InputError, shown
from reobserve.core.kernel import allocating_kernel
from reobserve.core.matrices import as_numbers, as_scalar

Array = NDArray[np.float64]

_MOST = 1_000_000_000  # samples, or entries of one


def cusum(increments: ArrayLike, start: float = 0.0) -> Array:
    """Page's cumulative sum g(k) = max(0, g(k-1) + s(k)), shape (k,).

    Parameters
    ----------
    increments
        s, shape (k,), nan where missing. Their mean is negative before a change and positive after
        it, as for the logarithm of the ratio of the likelihoods after and before.
    start
        g before the first increment: zero, or the last value of the record that this one continues.

    Raises
    ------
    InputError
        If an increment is beyond 1e300, or the start negative.

    Examples
    --------
    >>> from reobserve.detection.innovation_tests import cusum
    >>> print(cusum([-1.0, -0.5, 2.0, 1.0, -0.5]))
    [0.  0.  2.  3.  2.5]
    """
    first = as_scalar("start", start)
    if first < 0:
        raise InputError("start", f"{first:g} must be 0 or more")
    return _cusum(as_record("increments", increments), first)


def inflation_glr(distances: ArrayLike, outputs: int, lengths: ArrayLike) -> Array:
    """Logarithm of the generalised likelihood ratio for larger innovations, shape (k,).

    Before the change an innovation has the covariance S, from the change on c S, with c > 1 and the
    time of the change unknown. Over the last n samples, whose distances sum to Q, the maximum over
    c is at c = Q / (n m) and is [Q - n m - n m ln(Q / (n m))] / 2, or zero if Q < n m. The
    statistic is the maximum over all lengths n that fit in the record so far.

    Parameters
    ----------
    distances
        d = e' S^-1 e of the innovations e, shape (k,), nan where missing. They are chi-squared with
        m degrees of freedom, so their mean is m, as long as the filter's model holds.
    outputs
        m, the number of entries of an innovation.
    lengths
        n, whole numbers from 1 on: the samples since a possible change. A few of them, such as
        powers of two, are nearly as good as all (Lai 1995).

    Raises
    ------
    InputError
        If a distance is negative or beyond 1e300, or a number is not whole, less than 1 or huge.

    Examples
    --------
    >>> from reobserve.detection.innovation_tests import inflation_glr
    >>> print(inflation_glr([1.0, 0.8, 9.0, 8.0], outputs=1, lengths=[1, 2, 4]).round(2))
    [0.   0.   2.9  5.36]
    """
    return _inflation_glr(*as_windows(distances, outputs, lengths))


def inflated(
    distances: ArrayLike, outputs: int, lengths: ArrayLike, probability: float = 1e-3
) -> NDArray[np.bool_]:
    """Samples at which innovations are too large for the filter's model, shape (k,).

    True where the sum of the last n distances, of those that are not missing, is beyond the
    quantile of its chi-squared distribution with n m degrees of freedom for one of the lengths.

    Parameters
    ----------
    distances, outputs, lengths
        As in `inflation_glr`.
    probability
        That a record of the filter's own model has such a sample, at most; it is divided among all
        samples and lengths (Bonferroni).

    Raises
    ------
    InputError
        As `inflation_glr`; and if the probability is not between 0 and 1.

    Examples
    --------
    >>> from reobserve.detection.innovation_tests import inflated
    >>> print(inflated([1.0, 0.8, 30.0, 0.5], outputs=1, lengths=[1, 2]))
    [False False  True  True]
    """
    record, m, each = as_windows(distances, outputs, lengths)
    share = as_scalar("probability", probability)
    if not 0 < share < 1:
        raise InputError("probability", f"{share:g} must be between 0 and 1")
    large, taken = np.zeros(len(record), dtype=bool), ~np.isnan(record)
    large[taken] = inflated_rows(record[taken], m, each, share)
    return large


def as_windows(
    distances: ArrayLike, outputs: int, lengths: ArrayLike
) -> tuple[Array, int, NDArray[np.int64]]:
    """The arguments of `inflation_glr`, checked (raises as it does)."""
    record = as_record("distances", distances)
    if len(below := np.flatnonzero(record < 0)):
        raise InputError("distances", f"{record[below[0]]:g} at row {below[0]} must be 0 or more")
    m = as_whole("outputs", outputs, 1, _MOST)
    values = as_numbers("lengths", lengths)
    wrong = (values < 1) | (values > _MOST) | (values != np.floor(values))
    if values.ndim != 1 or not len(values) or wrong.any():
        raise InputError("lengths", f"{shown(lengths)} must be whole numbers from 1 to {_MOST}")
    return record, m, values.astype(np.int64)


def as_record(name: str, value: ArrayLike, *, wide: bool = False) -> Array:
    """Numbers, shape (k,), or also (k, m) if they may be ``wide``, nan where missing."""
    record = as_numbers(name, value)
    if record.ndim != 1 and not (wide and record.ndim == 2):
        problem = f"have shape {record.shape}, must be (k,)"
        raise InputError(name, f"{problem} or (k, m)" if wide else problem)
    most = 1e140 if wide else 1e300  # sums of their squares, or their sums are floats
    if len(beyond := np.argwhere(np.abs(record) > most)):
        raise InputError(name, f"must be within {most:g}, are not at row {beyond[0, 0]}")
    return record


@allocating_kernel
def _cusum(increments: Array, start: float) -> Array:
    statistic, last = np.empty(len(increments)), start
    # g(k) = max(0, g(k-1) + s(k))
    for k in range(len(increments)):
        if not math.isnan(increments[k]):
            last = max(0.0, last + increments[k])
        statistic[k] = last
    return statistic


@allocating_kernel
def _inflation_glr(distances: Array, outputs: int, lengths: NDArray[np.int64]) -> Array:
    """``totals`` are the sums of the first 0, 1, 2, ... distances that are not missing."""
    statistic, totals = np.empty(len(distances)), np.zeros(len(distances) + 1)
    taken, last = 0, 0.0
    for k in range(len(distances)):
        if not math.isnan(distances[k]):
            taken += 1
            totals[taken] = totals[taken - 1] + distances[k]
            last = 0.0
            # The maximum over n of [Q - n m - n m ln(Q / (n m))] / 2, or 0 where Q < n m
            for length in lengths:
                if length <= taken:
                    expected = float(length * outputs)
                    total = totals[taken] - totals[taken - length]
                    if total > expected:
                        ratio = 0.5 * (total - expected - expected * math.log(total / expected))
                        last = max(last, ratio)
        statistic[k] = last
    return statistic
