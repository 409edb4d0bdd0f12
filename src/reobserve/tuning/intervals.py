"""Intervals of means over records, at which one may look after every record.

Records are added until a question is decided, and the best of several methods is found on the same
records. Both make a usual interval too narrow. Here

- an interval that is looked at more than once covers the mean at all numbers of records at once. Of
  n normal numbers with the mean m, the mean of the sample and its standard deviation s are further
  apart than T s / sqrt(n) for any n with a probability of 5 % at most, where

      T^2 = (n - 1) (Q - 1) / (1 - Q / (1 + n g)),     Q = ((1 + n g) / 0.05^2)^(1/n):

  the likelihood ratio of the t statistic for a mean over deviation from a normal distribution of
  variance g is a martingale (Lai 1976, Ann. Statist. 4:265; Wang & Ramdas 2025, Sequential Anal.
  44:56). For other numbers it holds as n grows;
- a method is worse than the best of the others if it is worse than the one that was best on the
  records *before*, another one at each record: a reference that the record itself cannot choose.
  It is no worse than the best if it is no worse than each of them (Hsu 1984, Ann. Statist. 12,
  1136).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

LEVEL = 0.05  # the probability that an interval does not cover
_EFFECT = 1 / 8  # g; intervals are narrowest, compared with others of this kind, near 64 records

Array = NDArray[np.float64]


def anytime_quantile(count: int) -> float:
    """T for so many records: of one interval of all that are looked at."""
    if count < 2:
        return math.inf
    more = 1.0 + count * _EFFECT
    Q = (more / LEVEL**2) ** (1.0 / count)
    return math.sqrt((count - 1) * (Q - 1.0) / (1.0 - Q / more)) if more > Q else math.inf


def student_quantile(count: int) -> float:
    """The same for an interval that is looked at once, of Student's distribution."""
    from scipy.special import stdtrit

    return float(stdtrit(count - 1, 1.0 - LEVEL / 2)) if count > 1 else math.inf


def interval(logs: Array, *, anytime: bool = False, more: float = 0.0) -> tuple[float, ...]:
    """The geometric mean of exp(logs), and its interval of 95 %.

    ``more`` is a variance of the mean that the records have in common, besides that of records.
    """
    mean, half = _mean(logs, anytime, more)
    return _exp(mean, mean - half, mean + half)


def against_others(
    logs: Array, own: int, others: Sequence[int], *, anytime: bool = False,
    redrawn: Array | None = None,
) -> tuple[float, ...]:  # fmt: skip
    """The ratio of a row's geometric mean to the smallest of others, and its interval of 95 %.

    Parameters
    ----------
    logs
        Logarithms of errors, shape (rows, records).
    own
        The row.
    others
        The rows that it is compared with.
    redrawn
        The same logarithms for other draws of what all records have in common, shape (draws, rows,
        records).
    """
    others = [row for row in others if row != own]
    if not others:
        return 1.0, 1.0, 1.0
    best = min(others, key=lambda k: float(logs[k].mean()))
    ratio = float(logs[own].mean() - logs[best].mean())
    high = max(
        sum(_mean(logs[own] - logs[k], anytime, common_variance(redrawn, own, k))) for k in others
    )
    before = np.cumsum(logs[others], axis=1)[:, :-1]
    reference = np.array(others)[np.argmin(before, axis=0)]
    later = np.arange(1, logs.shape[1])
    mean, half = _mean(
        logs[own, later] - logs[reference, later], anytime, common_variance(redrawn, own, best)
    )
    return _exp(ratio, min(mean - half, ratio), high)


def common_variance(redrawn: Array | None, own: int, other: int | None = None) -> float:
    """The variance over draws of a row's mean, or of its difference from another row's."""
    if redrawn is None or not len(redrawn):
        return 0.0
    means = redrawn[:, own].mean(axis=1)
    return float(np.var(means if other is None else means - redrawn[:, other].mean(axis=1), ddof=1))


def _mean(values: Array, anytime: bool, more: float) -> tuple[float, float]:
    """The mean and half the width of its interval."""
    count = len(values)
    quantile = anytime_quantile(count) if anytime else student_quantile(count)
    spread = values.std(ddof=1) if count > 1 else 1.0
    deviation = math.sqrt(spread**2 / count + more)
    return float(values.mean()), quantile * deviation if deviation else 0.0


def _exp(*values: float) -> tuple[float, ...]:
    return tuple(math.exp(value) if value < 700 else math.inf for value in values)
