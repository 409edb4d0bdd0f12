"""Size, settling and decay of an estimation error, and its ratio to another."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve_papers.metrics import responses
from reobserve_papers.metrics.responses import check_windows

Array = NDArray[np.float64]

# Of an error over a run: the integral of its square or of its absolute value, or the time until it
# settles.
MEASURES = ("square", "absolute", "settling")


def integral_of_squares(error: Array, step: float) -> Array:
    """The integral of each component's square over time, shape (n,), by the trapezoidal rule."""
    squares = error * error
    total: Array = step * (squares.sum(axis=0) - 0.5 * (squares[0] + squares[-1]))
    return total


def integral_of_sizes(error: Array, step: float) -> Array:
    """The integrals of |e| and of each component's absolute value, shape (1 + n,), as above."""
    sizes = np.column_stack([np.linalg.norm(error, axis=1), np.abs(error)])
    total: Array = step * (sizes.sum(axis=0) - 0.5 * (sizes[0] + sizes[-1]))
    return total


def settling_time(error: Array, step: float, band: float) -> float:
    """Time after which |e| stays within ``band`` times its initial value [s], or nan if never."""
    size = np.linalg.norm(error, axis=1)
    return settling_time_of(size, step, float(band * size[0]))


def settling_time_of(size: Array, step: float, level: float) -> float:
    """Time after which a size stays within ``level`` [s], or nan if never."""
    # Each sample stands for the step that begins with it.
    time = np.arange(len(size) + 1, dtype=np.float64) * step
    return responses.settling_time(time, size, size, level)


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
    """Share of runs with a smaller error than the reference, where nan counts as infinite."""
    mine, other = (np.asarray(runs, dtype=np.float64) for runs in (ise, reference))
    return float(np.mean(mine < np.where(np.isnan(other), np.inf, other)))


def ratios(ise: ArrayLike, reference: ArrayLike) -> Array:
    """Squared errors over those of the reference, or inf where a run diverged."""
    sizes = np.asarray(ise, dtype=np.float64)
    return np.where(np.isnan(sizes), np.inf, sizes) / np.asarray(reference, dtype=np.float64)


def largest_improvement(sizes: ArrayLike, reference: ArrayLike) -> float:
    """The largest relative reduction of an error in any run, or 0 if there is none.

    An error that diverges or never settles (nan) is infinite; two of them are equal.
    """
    mine, other = (np.asarray(runs, dtype=np.float64) for runs in (sizes, reference))
    mine, other = (np.where(np.isnan(runs), np.inf, runs) for runs in (mine, other))
    with np.errstate(invalid="ignore"):
        gain = np.where(mine < other, 1.0 - mine / other, 0.0)
    return float(np.max(np.where(np.isinf(other) & np.isfinite(mine), 1.0, gain)))
