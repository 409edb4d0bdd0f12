"""Consistency of a filter with its own covariances: normalised innovations and errors, bounds.

NIS, e' S^-1 e of an innovation e, and NEES, the same of an estimation error and its covariance, are
chi-squared with as many degrees of freedom as they have entries, if the filter's model is the
plant's (Bar-Shalom, Li & Kirubarajan 2001, Section 5.4). The mean over N records is chi-squared
with N times as many, over N.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtrc, chdtri

from reobserve.core.arguments import as_kind, as_whole
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_numbers, as_scalar
from reobserve.observers.run import Run
from reobserve.systems.periods import wrapped

Array = NDArray[np.float64]

_LARGEST = 1000.0  # a distance whose probability is a float


def normalised(run: Run[Any]) -> tuple[Array, Array]:
    """The distances e' S^-1 e of a run's innovations, and the whitened innovations L^-1 e.

    L is the lower triangular square root of S. Of a run of many records, both have the records
    first.

    Parameters
    ----------
    run
        Of a filter with innovations.

    Returns
    -------
    distances
        Shape (k,), nan where a measurement is missing. Of a row of which only some outputs were
        measured, it is that of the same probability with m of them, so that all are chi-squared
        with m degrees of freedom.
    whitened
        Shape (k, m), nan for what is missing.

    Examples
    --------
    >>> from reobserve import KalmanFilter, LinearModel
    >>> from reobserve.detection import normalised
    >>> kalman = KalmanFilter(LinearModel([[1.0]], C=[[1.0]], Q=0.0, R=4.0))
    >>> run = kalman.run([2.0, 2.0, -8.0], start=kalman.init([0.0], 0.0))
    >>> distances, whitened = normalised(run)
    >>> print(distances, whitened[:, 0])
    [ 1.  1. 16.] [ 1.  1. -4.]
    """
    run = as_kind("run", run, Run)
    return normalised_innovations(run["innovation"], run["innovation_covariance"])


def normalised_innovations(innovation: Array, covariance: Array) -> tuple[Array, Array]:
    """Distances and whitened innovations of `normalised`, from e, (..., m), and S, (..., m, m)."""
    distances, whitened = _normalised(innovation, covariance)
    m = whitened.shape[-1]
    measured = (~np.isnan(whitened)).sum(axis=-1)
    for count in range(1, m):
        some = measured == count
        taken = np.minimum(distances[some], _LARGEST)
        same = chdtri(m, chdtrc(count, taken))
        distances[some] = same + (distances[some] - taken)
    return distances, whitened


def nees(run: Run[Any], state: ArrayLike) -> Array:
    """The normalised squared errors of a run's states, shape (k,), with the records first.

    Parameters
    ----------
    run
        Of a filter with ``state`` and ``covariance``.
    state
        The true states, of the shape of ``run["state"]``; nan where they are not known.

    Raises
    ------
    InputError
        If the run is none, the states have another shape, or squares of errors overflow.

    Examples
    --------
    >>> from reobserve import KalmanFilter, LinearModel
    >>> from reobserve.detection import nees
    >>> kalman = KalmanFilter(LinearModel([[1.0]], C=[[1.0]], Q=0.0, R=1.0))
    >>> run = kalman.run([1.0, 1.0], start=kalman.init([0.0], 1.0))
    >>> print(nees(run, [[1.0], [1.0]]).round(3))
    [0.5   0.333]
    """
    run = as_kind("run", run, Run)
    estimates, truth = run["state"], as_numbers("state", state)
    if truth.shape != estimates.shape:
        raise InputError("state", f"has shape {truth.shape}, must be {estimates.shape}")
    errors = wrapped(truth - estimates, run.periods.get("state", 0.0))
    squares = _normalised(errors, run["covariance"])[0]
    if np.isinf(squares).any():
        raise InputError("state", f"{np.nanmax(np.abs(truth)):g} is too far from the estimates")
    return squares


@dataclass(frozen=True, eq=False)
class Consistency:
    """Mean normalised squares over records, with the bounds between which they should be.

    Attributes
    ----------
    mean
        Over the records, shape (k,), nan where there is none.
    lower, upper
        Its bounds, shape (k,).

    Examples
    --------
    >>> from reobserve.detection import consistency
    >>> found = consistency([[0.9, 30.0], [1.3, 28.0]], dimension=1)
    >>> print(found.mean, found.upper.round(2), found.inside)
    [ 1.1 29. ] [3.69 3.69] 0.5
    """

    mean: Array
    lower: Array
    upper: Array

    @property
    def inside(self) -> float:
        """The share of samples inside the bounds, nan if there are none."""
        known = ~np.isnan(self.mean)
        within = (self.mean >= self.lower) & (self.mean <= self.upper)
        return float(within[known].mean()) if known.any() else float("nan")


def consistency(distances: ArrayLike, dimension: int, probability: float = 0.95) -> Consistency:
    """Means of NIS or NEES over records, and bounds of chi-squared.

    Parameters
    ----------
    distances
        Of one record, shape (k,), or of several, (records, k); nan where missing.
    dimension
        The entries of an innovation, or of a state.
    probability
        With which a mean is between the bounds, if the filter's model is the plant's.

    Examples
    --------
    >>> import numpy as np
    >>> from reobserve.detection import consistency
    >>> found = consistency(np.random.default_rng(1).chisquare(2, (50, 1000)), dimension=2)
    >>> print(round(found.lower[0], 2), round(found.upper[0], 2), round(found.inside, 2))
    1.48 2.59 0.95
    """
    record = as_numbers("distances", distances)
    if record.ndim not in (1, 2):
        raise InputError("distances", f"have shape {record.shape}, must be (k,) or (records, k)")
    if (record < 0).any() or np.isinf(record).any():
        raise InputError("distances", "must be finite, and 0 or more")
    freedom = as_whole("dimension", dimension, 1, 1_000_000)
    share = as_scalar("probability", probability)
    if not 0 < share < 1:
        raise InputError("probability", f"{share:g} must be between 0 and 1")
    rows = np.atleast_2d(record)
    count = (~np.isnan(rows)).sum(axis=0)
    known = np.where(count, count, np.nan)
    tail = (1.0 - share) / 2.0
    bounds = [chdtri(known * freedom, level) / known for level in (1.0 - tail, tail)]
    return Consistency(np.nansum(rows, axis=0) / known, *bounds)


def _normalised(errors: Array, covariances: Array) -> tuple[Array, Array]:
    """The distances and whitened errors of what is there, nan where nothing is."""
    missing = np.isnan(errors)
    either = missing[..., :, None] | missing[..., None, :]
    spread = np.where(either, np.eye(errors.shape[-1]), covariances)
    try:
        root = np.linalg.cholesky(spread)
    except np.linalg.LinAlgError:
        raise InputError("run", "has a covariance that is not positive definite") from None
    known = np.where(missing, 0.0, errors)
    whitened = np.asarray(np.linalg.solve(root, known[..., None])[..., 0], dtype=np.float64)
    with np.errstate(over="ignore"):
        distances = (whitened**2).sum(axis=-1)
    distances[missing.all(axis=-1)] = np.nan
    whitened[missing] = np.nan
    return distances, whitened
