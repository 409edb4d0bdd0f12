"""Detectors of a change: a statistic of a filter's innovations, and a threshold by false alarms.

While a Kalman filter's model holds, its innovations e(k) are independent and normal, with mean zero
and the covariance S(k) that it computes. So the distances e' S^-1 e are chi-squared with m degrees
of freedom, and the whitened innovations L^-1 e, S = L L', are standard normal (`normalised`). From
this the thresholds follow, each for a rate of false alarms per sample.

- `chi_square_window` sums the distances of the last n samples: for any fault.
- `cusum_of_mean` is quick for a shift of the mean whose size is known (Page 1954; Lorden 1971).
- `glr_of_mean` and `glr_of_size` are likelihood ratios for a shift of the mean, and for a larger
  covariance, both of unknown size and time (Willsky & Jones 1976; Lai 1995).

Where the model does not hold without a fault either, take `false_alarm_threshold` of records.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtrc, chdtri, ndtr

from reobserve.core.arguments import as_whole
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_positive, as_scalar
from reobserve.detection.innovation_tests import as_record, as_windows, cusum, inflation_glr

Array = NDArray[np.float64]

_LEAST = 1e-9  # rate of false alarms: one in 30 years at a hertz
_MOST = 0.1
_NODES = 30  # of the integral equation of `cusum_of_mean`, and eight more for each deviation
_FARTHEST = 60.0  # deviations, of its threshold
_LONGEST = 1e6  # of the wanted run length: what is beyond is no matter of digits


@dataclass(frozen=True, eq=False)
class Detection:
    """Findings of a detector on a record of k samples.

    Attributes
    ----------
    statistic
        Shape (k,). At a missing sample it keeps its value. Before a window is full it is nan, that
        of a sum or a likelihood ratio 0.
    threshold
        An alarm is raised where the statistic exceeds it.

    Examples
    --------
    >>> from reobserve.detection import chi_square_window
    >>> found = chi_square_window([1.0, 0.8, 30.0, 0.5], 1, length=2, false_alarm_rate=1e-3)
    >>> print(found.alarm, found.first)
    [False False  True  True] 2
    """

    statistic: Array
    threshold: float

    @property
    def alarm(self) -> NDArray[np.bool_]:
        """True where an alarm is raised, shape (k,)."""
        raised: NDArray[np.bool_] = self.statistic > self.threshold
        return raised

    @property
    def first(self) -> int | None:
        """The row of the first alarm, or None."""
        rows = np.flatnonzero(self.alarm)
        return int(rows[0]) if len(rows) else None


def chi_square_window(
    distances: ArrayLike, outputs: int, length: int, false_alarm_rate: float
) -> Detection:
    """Sum of the last n distances against the quantile of chi-squared with n m degrees of freedom.

    Parameters
    ----------
    distances
        e' S^-1 e, shape (k,), nan where missing, as `normalised` has them.
    outputs
        m, the number of entries of an innovation.
    length
        n: the longer, the smaller the faults that are found, and the later.
    false_alarm_rate
        The share of samples with an alarm as long as the model holds, from 1e-9 to 0.1.

    Raises
    ------
    InputError
        If a distance is negative or beyond 1e300, or a number is not in its range.

    Examples
    --------
    >>> from reobserve.detection import chi_square_window
    >>> found = chi_square_window([0.3, 1.2, 9.0, 8.0], 1, length=2, false_alarm_rate=1e-3)
    >>> print(found.statistic, round(found.threshold, 2))
    [ nan  1.5 10.2 17. ] 13.82
    """
    record, m, (n,) = as_windows(distances, outputs, [as_whole("length", length, 1, 1_000_000)])
    rate = _as_rate(false_alarm_rate)
    missing = np.isnan(record)
    statistic = _held(missing, _sums(record[~missing], int(n)), np.nan)
    return Detection(statistic, float(chdtri(int(n) * m, rate)))


def cusum_of_mean(values: ArrayLike, shift: float, false_alarm_rate: float) -> Detection:
    """Page's cumulative sums for a shift of the mean by d, upwards or downwards.

        g+(k) = max(0, g+(k-1) + x(k) - d/2),   g-(k) = max(0, g-(k-1) - x(k) - d/2)

    The statistic is the larger one. The mean number of samples to a false alarm follows from Page's
    integral equation, solved by Gauss's quadrature; of both sums it is half that of one, since one
    is zero when the other alarms (Kemp 1961).

    Parameters
    ----------
    values
        x, shape (k,): independent, with mean 0 and deviation 1 as long as the model holds, such as
        a whitened innovation of `normalised`; nan where missing.
    shift
        d, in deviations, above zero: the one that is found quickest.
    false_alarm_rate
        One over the mean number of samples to a false alarm, from 1e-9 to 0.1.

    Raises
    ------
    InputError
        If a value is beyond 1e300, or a number is not in its range.

    Examples
    --------
    >>> from reobserve.detection import cusum_of_mean
    >>> found = cusum_of_mean([0.1, -0.4, 2.0, 3.0, 2.5, 2.0], shift=1.0, false_alarm_rate=1 / 168)
    >>> print(found.statistic, round(found.threshold, 2))
    [0.  0.  1.5 4.  6.  7.5] 4.0
    """
    record = as_record("values", values)
    allowance = as_positive("shift", shift) / 2.0
    rate = _as_rate(false_alarm_rate)
    both = [cusum(sign * record - allowance) for sign in (1.0, -1.0)]
    return Detection(np.maximum(*both), _cusum_threshold(allowance, 2.0 / rate))


def glr_of_mean(values: ArrayLike, lengths: ArrayLike, false_alarm_rate: float) -> Detection:
    """Logarithm of the likelihood ratio of a shift of the mean by an unknown vector.

    Over the last n samples with the sum s it is at most |s|^2 / (2 n), which is half a chi-squared
    variable of m degrees of freedom. The statistic is the maximum over the lengths n, each of which
    has its share of the false alarms (Bonferroni).

    Parameters
    ----------
    values
        Whitened innovations of `normalised`, shape (k, m) or (k,); a row with nan is missing.
    lengths
        n, whole numbers from 1 on: the samples since a possible change.
    false_alarm_rate
        The share of samples with an alarm as long as the model holds, at most, from 1e-9 to 0.1.

    Raises
    ------
    InputError
        If a value is beyond 1e140, or a number is not in its range.

    Examples
    --------
    >>> from reobserve.detection import glr_of_mean
    >>> found = glr_of_mean([0.1, -0.4, 2.0, 3.0], lengths=[1, 2], false_alarm_rate=1e-3)
    >>> print(found.statistic.round(2), round(found.threshold, 2))
    [0.01 0.08 2.   6.25] 6.06
    """
    record = as_record("values", values, wide=True)
    rows = record if record.ndim == 2 else record[:, None]
    _, _, each = as_windows([], 1, lengths)
    rate = _as_rate(false_alarm_rate)

    def ratio(taken: Array) -> Array:
        statistic = np.zeros(len(taken))
        for n in each[each <= len(taken)].tolist():
            sums = sliding_window_view(taken, n, axis=0).sum(axis=-1)
            ratios = (sums**2).sum(axis=1) / (2.0 * n)
            statistic[n - 1 :] = np.maximum(statistic[n - 1 :], ratios)
        return statistic

    missing: NDArray[np.bool_] = np.asarray(np.isnan(rows).any(axis=1))
    statistic = _held(missing, ratio(rows[~missing]), 0.0)
    return Detection(statistic, float(chdtri(rows.shape[1], rate / len(each))) / 2.0)


def glr_of_size(
    distances: ArrayLike, outputs: int, lengths: ArrayLike, false_alarm_rate: float
) -> Detection:
    """Logarithm of the likelihood ratio of innovations that have become larger, `inflation_glr`.

    Parameters
    ----------
    distances, outputs, lengths
        As in `reobserve.detection.innovation_tests.inflation_glr`.
    false_alarm_rate
        The share of samples with an alarm as long as the model holds, at most, from 1e-9 to 0.1:
        the sum of the probabilities of all lengths.

    Raises
    ------
    InputError
        If a distance is negative or beyond 1e300, or a number is not in its range.

    Examples
    --------
    >>> from reobserve.detection import glr_of_size
    >>> found = glr_of_size([1.0, 0.8, 9.0, 8.0], 1, lengths=[1, 2], false_alarm_rate=1e-2)
    >>> print(found.statistic.round(2), round(found.threshold, 2))
    [0.   0.   2.9  5.36] 2.53
    """
    from scipy.optimize import brentq

    record, m, each = as_windows(distances, outputs, lengths)
    rate = _as_rate(false_alarm_rate)
    statistic = inflation_glr(record, m, each)

    def excess(level: float) -> float:
        # P([Q - a - a ln(Q / a)] / 2 > h and Q > a) with a = n m, Q chi-squared
        freedom = (each * m).tolist()
        shares = [float(chdtrc(a, a * _inflation(2.0 * level / a))) for a in freedom]
        return sum(shares) - rate

    highest = 1.0
    while excess(highest) > 0:
        highest *= 2.0
    threshold = brentq(excess, 0.0, highest, xtol=1e-12) if excess(0.0) > 0 else 0.0
    return Detection(statistic, float(threshold))


def _inflation(excess: float) -> float:
    """The c > 1 with c - 1 - ln c = excess, by Newton's method from above, where it converges."""
    c = 1.0 + math.sqrt(2.0 * excess) + excess
    for _ in range(60):
        step = (c - 1.0 - math.log(c) - excess) / (1.0 - 1.0 / c) if c > 1 else 0.0
        c -= step
        if abs(step) <= 1e-15 * c:
            break
    return c


def _cusum_threshold(allowance: float, length: float) -> float:
    """The h at which one sum takes so many samples, in the mean, to exceed it."""
    from scipy.optimize import brentq

    def excess(h: float) -> float:
        return math.log(min(_run_length(allowance, h) / length, _LONGEST))

    if excess(0.0) >= 0:
        return 0.0
    highest = 0.2
    while excess(highest) < 0 and highest < _FARTHEST:
        highest *= 1.5
    if excess(highest) < 0:
        problem = f"{2.0 * allowance:g} is too small for so few false alarms"
        raise InputError("shift", f"{problem}: the threshold is above {_FARTHEST:g} deviations")
    return float(brentq(excess, 0.0, highest, xtol=1e-12))


def _run_length(allowance: float, h: float) -> float:
    """The mean number of samples to the first g > h from g = 0, by Page's integral equation.

    L(u) = 1 + L(0) Phi(r - u) + integral from 0 to h of L(y) phi(y + r - u) dy
    """
    if h == 0.0:
        share = float(ndtr(-allowance))
        return 1.0 / share if share > 0 else math.inf
    nodes, weights = np.polynomial.legendre.leggauss(_NODES + 8 * math.ceil(h))
    y, w = 0.5 * h * (nodes + 1.0), 0.5 * h * weights
    at = np.concatenate([[0.0], y])
    matrix = np.eye(len(at))
    matrix[:, 0] -= ndtr(allowance - at)
    matrix[:, 1:] -= w * np.exp(-0.5 * (y + allowance - at[:, None]) ** 2) / math.sqrt(2 * math.pi)
    return float(np.linalg.solve(matrix, np.ones(len(at)))[0])


def _as_rate(value: float) -> float:
    rate = as_scalar("false_alarm_rate", value)
    if not _LEAST <= rate <= _MOST:
        problem = f"{rate:g} must be from {_LEAST:g} to {_MOST:g} alarms per sample"
        raise InputError("false_alarm_rate", problem)
    return rate


def _held(missing: NDArray[np.bool_], statistic: Array, start: float) -> Array:
    """A statistic of the samples that are there, held at the others, ``start`` before them."""
    return np.concatenate([[start], statistic])[np.cumsum(~missing)]


def _sums(taken: Array, n: int) -> Array:
    """Sums of the last n, each of its own: after a huge one the next are exact again."""
    sums = np.full(len(taken), np.nan)
    if n <= len(taken):
        with np.errstate(over="ignore"):
            sums[n - 1 :] = sliding_window_view(taken, n).sum(axis=1)
    return sums
