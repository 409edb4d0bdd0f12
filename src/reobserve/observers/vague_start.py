"""Digits that covariances of a start lose when measurements are far more precise.

A correction from the variance p to the variance q leaves of 16 digits about 16 - log10(p / q): the
covariance after it is the small difference of large numbers.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FILTERED = 1e12  # how far the variance of a state may fall from one row to the next
SMOOTHED = 1e10  # or by what later rows say of it


class VagueStartWarning(UserWarning):
    """The covariance of a start is so large beside that of measurements that digits are lost."""


def warn_of_start(start: Array, variances: Array, level: int = 5) -> bool:
    """Warn the caller of `run` or `step` if a variance falls too far in one of the first rows.

    ``start`` are the variances before them, (n,), and ``variances`` those after each, (k, n). True
    if there was a warning; ``level`` is that of the caller.
    """
    before = start.tolist()
    for row, found in enumerate(variances.tolist()):  # few: numpy takes longer
        for state, (last, after) in enumerate(zip(before, found, strict=True)):
            if last > FILTERED * after:
                _warn(
                    f"the variance of state {state + 1} falls from {last:g} to {after:g} at row "
                    f"{row}",
                    "begin with a smaller covariance", level,
                )  # fmt: skip
                return True
        before = found
    return False


def warn_of_starts(starts: Array, variances: Array, goods: NDArray[np.int64]) -> None:
    """Do so for the first of many records with such a start.

    The arrays are (records, n) and (records, k, n); ``goods`` are the good rows of each.
    """
    before = np.concatenate([starts[:, None], variances[:, :-1]], axis=1)
    for record in np.flatnonzero((before / FILTERED > variances).any(axis=(1, 2))):
        if warn_of_start(starts[record], variances[record, : goods[record]], 7):
            return


def warn_of_smoothed(filtered: Array, smoothed: Array) -> None:
    """Warn if smoothed variances, (k, n), are too far below those of the filter, or negative."""
    falls = smoothed * SMOOTHED < filtered
    if falls.any():
        row, state = np.argwhere(falls)[0].tolist()
        _warn(
            f"the variance of state {state + 1} is {filtered[row, state]:g} at row {row} before, "
            f"and {smoothed[row, state]:g} after smoothing",
            "begin the filter with a smaller covariance", 4,
        )  # fmt: skip


def _warn(problem: str, remedy: str, level: int) -> None:
    sentence = f"covariance: {problem}, so that rounding leaves few digits of it; {remedy}"
    warnings.warn(sentence, VagueStartWarning, stacklevel=level)
