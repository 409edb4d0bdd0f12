"""Sums of squared innovations, compared with their chi-squared distribution."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

Array = NDArray[np.float64]


def inflated_rows(
    distances: Array, outputs: int, lengths: NDArray[np.int64], probability: float
) -> NDArray[np.bool_]:
    """True where the sum of the last n distances is too large for one of the lengths n.

    A distance e' S^-1 e of m outputs is chi-squared with m degrees of freedom, so that the sum of n
    is with n m. Each of the tests, one a row and length, fails with the same probability, such that
    a record of a right model has a true row with ``probability`` at most.
    """
    totals = np.concatenate([[0.0], np.cumsum(distances)])
    large = np.zeros(len(distances), dtype=bool)
    for length in lengths[lengths <= len(distances)].tolist():
        sums = np.maximum(totals[length:] - totals[:-length], 0.0)
        share = chdtrc(length * outputs, sums)
        large[length - 1 :] |= share < probability / (len(distances) * len(lengths))
    return large
