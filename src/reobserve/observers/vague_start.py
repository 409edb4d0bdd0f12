"""Digits that covariances of a start lose when measurements are far more precise.

A correction from the variance p to the variance q leaves of 16 digits about 16 - log10(p / q): the
covariance after it is the small difference of large numbers. So it is with two measurements of one
quantity that are far more precise than it is known: the covariance of their innovations is then
nearly singular, and what they say beside each other is lost.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FILTERED = 1e12  # how far the variance of a state may fall from one row to the next
SMOOTHED = 1e10  # or by what later rows say of it

REMEDY = (
    "begin with a smaller covariance, and give less process noise, so that measurements are "
    "predicted with variances of at most 1e10 times R"
)


class VagueStartWarning(UserWarning):
    """The covariance of a start is so large beside that of measurements that digits are lost.

    ``row`` is that of the run, and ``sentence`` has ``{at}`` in its place.
    """

    def __init__(self, sentence: str, row: int) -> None:
        super().__init__(sentence, row)
        self.sentence, self.row = sentence, row

    def __str__(self) -> str:
        return self.sentence.format(at=f"row {self.row}")


def warn_of_start(
    start: Array, variances: Array, level: int = 5, innovations: Array | None = None
) -> bool:
    """Warn the caller of `run` or `step` if a variance falls too far in one of the first rows.

    ``start`` are the variances before them, (n,), and ``variances`` those after each, (k, n);
    ``innovations`` are the covariances of the innovations, (k, m, m), which say it of measurements.
    True if there was a warning; ``level`` is that of the caller.
    """
    before = start.tolist()
    for row, now in enumerate(variances.tolist()):  # few: numpy takes longer
        for state, (last, after) in enumerate(zip(before, now, strict=True)):
            if last > FILTERED * after > 0.0:  # zero is known, not vague
                _warn(
                    f"the variance of state {state + 1} falls from {last:g} to {after:g} at {{at}}",
                    row, REMEDY, level,
                )  # fmt: skip
                return True
        before = now
    if innovations is not None and innovations.shape[1] > 1:
        least = _least(innovations)
        row = int(np.argmin(least)) if len(least) else 0
        if len(least) and least[row] * FILTERED < 1.0:
            _warn(
                "measurements of the same are far more precise than their prediction at "
                "{at}: the covariance of their innovation is nearly singular (its correlation "
                f"matrix has the eigenvalue {least[row]:.1g})",
                row, REMEDY, level,
            )  # fmt: skip
            return True
    return False


def _least(innovations: Array) -> Array:
    """The least eigenvalues of correlation matrices, (..., k), with ones for what is missing."""
    size = innovations.shape[-1]
    known = np.where(np.isnan(innovations), np.eye(size), innovations)
    deviations = np.sqrt(known.diagonal(axis1=-2, axis2=-1))
    correlations = known / deviations[..., :, None] / deviations[..., None, :]
    return np.asarray(np.linalg.eigvalsh(correlations)[..., 0], dtype=np.float64)


def warn_of_starts(
    starts: Array, variances: Array, goods: NDArray[np.int64], innovations: Array
) -> None:
    """Do so for the first of many records with such a start.

    The arrays are those of `warn_of_start`, of each record; ``goods`` are the good rows of each.
    """
    before = np.concatenate([starts[:, None], variances[:, :-1]], axis=1)
    doubtful = (before / FILTERED > variances).any(axis=(1, 2))
    if innovations.shape[-1] > 1:
        good = np.arange(innovations.shape[1]) < goods[:, None]
        least = _least(np.where(good[..., None, None], innovations, np.nan))
        doubtful |= (least * FILTERED < 1.0).any(axis=1)
    for record in np.flatnonzero(doubtful):
        last = goods[record]
        parts = starts[record], variances[record, :last], 8, innovations[record, :last]
        if warn_of_start(*parts):
            return


def warn_of_smoothed(filtered: Array, smoothed: Array) -> None:
    """Warn if smoothed variances, (k, n), are too far below those of the filter, or negative."""
    falls = smoothed * SMOOTHED < filtered
    if falls.any():
        row, state = np.argwhere(falls)[0].tolist()
        _warn(
            f"the variance of state {state + 1} is {filtered[row, state]:g} at {{at}} before, "
            f"and {smoothed[row, state]:g} after smoothing",
            row, f"{REMEDY}, or smooth with a short `lag`", 4,
        )  # fmt: skip


def _warn(problem: str, row: int, remedy: str, level: int) -> None:
    sentence = f"covariance: {problem}, so that rounding leaves few digits of it; {remedy}"
    warnings.warn(VagueStartWarning(sentence, row), stacklevel=level)
