"""Consistency of a record with the filter's model: tests of whether its innovations are white.

As long as the model holds, the whitened innovations w(k) = L^-1 e(k), S = L L', are independent and
standard normal. Three statistics say so, each over a fifth of the rows:

- NIS, the mean of e' S^-1 e over the number m of outputs: n m times it is chi-squared with n m
  degrees of freedom,
- the lag-1 autocorrelation of each component of w, about its mean: normal, with variance 1 / n,
- the mean of each component of w: normal, with variance 1 / n.

Of the five fifths the median counts, so that a start or a fault, of which alarms tell, is no
misfit. It is beyond a bound that one fifth passes with the probability q in no more than 10 q^3 of
the records. From that the bounds follow, for a rate of false alarms per record that is divided
among all statistics and sides. An observer whose noise is stated with a margin estimates well, so
the bounds are never closer than `TOLERATED`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, ndtri

from reobserve.detection.normalised_squares import normalised_innovations

Array = NDArray[np.float64]

RATE = 1e-4  # of false alarms, per record
TOLERATED = {"nis": 3.0, "autocorrelation": 0.5, "mean": 0.5}  # factor, share, deviations
_PARTS = 5


class Statistic(NamedTuple):
    """A statistic of the innovations, ``place`` that of its output, and its bounds."""

    name: str
    place: int
    value: float
    lower: float
    upper: float

    @property
    def fits(self) -> bool:
        """True if it is within its bounds."""
        return self.lower <= self.value <= self.upper


def statistics(
    innovation: Array, covariance: Array, rate: float = RATE,
    tolerated: Mapping[str, float] = TOLERATED,
) -> Iterator[Statistic]:  # fmt: skip
    """The statistics of innovations, (k, m), nan where missing, with covariances, (k, m, m)."""
    distances, whitened = normalised_innovations(innovation, covariance)
    m = whitened.shape[1]
    # P(three of five parts or more are beyond) < 10 q^3 = rate / (2 sides (1 + 2 m) statistics)
    q = float(np.cbrt(rate / (20.0 * (1 + 2 * m))))
    parts = _parts(distances)
    freedom = m * min(map(len, parts))
    if freedom:
        factor, value = tolerated["nis"], float(np.median([part.mean() / m for part in parts]))
        low, high = chdtri(freedom, [1.0 - q, q]) / freedom
        yield Statistic("nis", 0, value, min(low, 1.0 / factor), max(high, factor))
    for place, column in enumerate(whitened.T):
        parts = _parts(column)
        count = min(map(len, parts))
        if count < 2:
            continue
        means = [part.mean() for part in parts]
        # r = sum w(k) w(k-1) / sum w(k)^2, about the mean
        off = [part - mean for part, mean in zip(parts, means, strict=True)]
        lag = [(one[1:] @ one[:-1]) / max(float(one @ one), np.finfo(float).tiny) for one in off]
        for name, values in (("autocorrelation", lag), ("mean", means)):
            bound = max(-float(ndtri(q)) / np.sqrt(count), tolerated[name])
            yield Statistic(name, place, float(np.median(values)), -bound, bound)


def _parts(values: Array) -> list[Array]:
    """Parts of a column, one after the other, without values that are missing."""
    return np.array_split(values[np.isfinite(values)], _PARTS)
