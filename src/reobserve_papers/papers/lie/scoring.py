"""Size, settling and decay of an estimation error, and its ratio to another."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve_papers.metrics import responses
from reobserve_papers.metrics.responses import check_windows

Array = NDArray[np.float64]


def integral_of_squares(error: Array, step: float) -> Array:
    """The integral of each component's square over time, shape (n,), by the trapezoidal rule."""
    squares = error * error
    total: Array = step * (squares.sum(axis=0) - 0.5 * (squares[0] + squares[-1]))
    return total


def settling_time(error: Array, step: float, band: float) -> float:
    """Time after which |e| stays within ``band`` times its initial value [s], or nan if never."""
    size = np.linalg.norm(error, axis=1)
    # Each sample stands for the step that begins with it.
    time = np.arange(len(size) + 1, dtype=np.float64) * step
    return responses.settling_time(time, size, size, float(band * size[0]))


def decay_rate(error: Array, step: float, start: float, end: float) -> float:
    """The mean slope of log |e| between two times [1/s], or nan beyond the record or at zero."""
    check_windows({"decay_window": (start, end)}, step * (len(error) - 1), step, least=2)
    first, last = round(start / step), round(end / step)
    if last >= len(error):
        return float("nan")
    before, after = (float(np.linalg.norm(error[k])) for k in (first, last))
    if before == 0.0 or after == 0.0:
        return float("nan")
    return float(np.log(after / before)) / ((last - first) * step)


def share_better(ise: ArrayLike, reference: ArrayLike) -> float:
    """Share of runs with a smaller squared error than the reference, without diverged runs."""
    with np.errstate(invalid="ignore"):
        return float(np.mean(np.asarray(ise) < np.asarray(reference)))


def ratios(ise: ArrayLike, reference: ArrayLike) -> Array:
    """Squared errors over those of the reference, or inf where a run diverged."""
    found = np.asarray(ise, dtype=np.float64)
    return np.where(np.isnan(found), np.inf, found) / np.asarray(reference, dtype=np.float64)
