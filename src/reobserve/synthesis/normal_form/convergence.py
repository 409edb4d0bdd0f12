"""Where a power series converges, as far as its first coefficients tell.

The homogeneous parts P_d of a series that converges up to a radius R grow like C d^c / R^d, the
power d^c by the kind of singularity at R. So a straight line is fitted to

    log |P_d| = log C + c log d - d log R

over the upper half of the degrees that have terms. |P_d| is Bombieri's norm, the largest value on
the complex unit sphere but for a factor between 1 and a power of d: R is the radius of the largest
complex ball around the origin in which the series converges. In a real direction it may converge
further; `Convergence.growth` looks along directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import InputError
from reobserve.power_series.maps import PolynomialMap

Array = NDArray[np.float64]

MARGIN = 0.05  # the estimate itself errs by some per cent
LEAST_PARTS = 4  # for a fit of three numbers
_NOTHING = 1e-12  # a part this small beside the largest coefficient is rounding


@dataclass(frozen=True, eq=False)
class Convergence:
    """An estimate of where a series converges.

    ``radius`` is that of the ball around the origin, inf for a series that ends; ``scale`` and
    ``power`` are C and c of the fit, over the ``degrees``.
    """

    series: PolynomialMap
    radius: float
    scale: float
    power: float
    degrees: tuple[int, ...]

    def growth(self, points: ArrayLike) -> Array:
        """By which factor the parts at each point, shape (k, n), grow from degree to degree.

        Below 1 the series converges there, above it does not; shape (k,).
        """
        parts = self.series.parts(np.asarray(points, dtype=np.float64))
        found = np.zeros(parts.shape[1])
        for d in self.degrees:
            size = np.linalg.norm(parts[d], axis=-1)
            np.maximum(found, (size / (self.scale * d**self.power)) ** (1.0 / d), out=found)
        return found

    def outside(self, points: ArrayLike, margin: float = MARGIN) -> NDArray[np.bool_]:
        """Which points of a trajectory, shape (k, n), lie outside or within ``margin`` of the edge.

        There the series does not converge, or so slowly that it is of no use.
        """
        return self.growth(points) >= 1.0 - margin


def convergence(series: PolynomialMap) -> Convergence:
    """Estimate where a series converges.

    Raises
    ------
    InputError
        If it goes on, but has too few parts in the upper half of its degrees for an estimate.
    """
    sizes = part_norms(series)
    start = max(2, (series.degree + 1) // 2)
    degrees = [d for d in range(start, series.degree + 1) if sizes[d] > _NOTHING * sizes.max()]
    if not degrees:
        return Convergence(series, np.inf, 1.0, 0.0, ())
    if len(degrees) < LEAST_PARTS:
        raise InputError(
            "degree",
            f"{series.degree} leaves {len(degrees)} parts with terms from degree {start} on, "
            f"must leave {LEAST_PARTS} for an estimate of the radius of convergence",
        )
    d = np.array(degrees, dtype=np.float64)
    columns = np.stack([np.ones_like(d), np.log(d), -d], axis=1)
    fit, *_ = np.linalg.lstsq(columns, np.log(sizes[degrees]), rcond=None)
    return Convergence(
        series, float(np.exp(fit[2])), float(np.exp(fit[0])), float(fit[1]), tuple(degrees)
    )


def part_norms(series: PolynomialMap) -> Array:
    """Bombieri's norm of each homogeneous part, shape (degree + 1,)."""
    basis = series.basis
    table = np.abs(series.coefficients.astype(np.float64)) ** 2
    norms = []
    for d in range(series.degree + 1):
        exponents = basis.exponents[basis.part(d)]
        weights = [np.prod([float(factorial(power)) for power in m]) for m in exponents.tolist()]
        norms.append(np.sqrt(np.sum(table[:, basis.part(d)] * weights) / factorial(d)))
    return np.array(norms)


def warning(domain: Convergence, states: ArrayLike, step: float) -> str | None:
    """A sentence if a trajectory sampled every ``step`` seconds leaves the domain; None if not."""
    outside = domain.outside(states)
    if not outside.any():
        return None
    first = int(np.argmax(outside)) * step
    return (
        f"the series converges up to a radius of {domain.radius:.3g} or little beyond; the "
        f"trajectory is outside or at the edge for {100 * float(np.mean(outside)):.3g} % of its "
        f"samples, first at t = {first:g} s, where a higher order need not be better"
    )
