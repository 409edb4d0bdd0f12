"""Radius of convergence of a power series, estimated from its first coefficients.

The homogeneous parts P_d of a series that converges up to a radius R grow like C d^c / R^d, the
power d^c by the kind of singularity at R. So a straight line is fitted to

    log |P_d| = log C + c log d - d log R

over the upper half of the degrees that have terms, and again without the first and without the
last of them: by how much the estimates of R differ says what they are worth. |P_d| is Bombieri's
norm, the largest value on the complex unit sphere but for a factor between 1 and a power of d: R
is the radius of the largest complex ball around the origin in which the series converges. In a
real direction it may converge further; `Convergence.growth` looks along directions.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.polynomials.maps import PolynomialMap

Array = NDArray[np.float64]

LEAST_PARTS = 4  # for a fit of three numbers
_NOTHING = 1e-12  # a part this small beside the others is rounding
_MAX_SPREAD = 0.05  # estimates that differ by more say that the degree is too low
_LEAST_ERROR = 0.05  # what an estimate errs by, however well it repeats


@dataclass(frozen=True, eq=False)
class Convergence:
    """An estimate of where a series converges.

    ``radius`` is that of the ball around the origin, inf for a series that ends; ``scale`` and
    ``power`` are C and c of the fit, over the ``degrees``; ``error`` is by what part of itself the
    radius may be off: some times what the estimates of fewer degrees differ by.
    """

    series: PolynomialMap
    radius: float
    scale: float
    power: float
    degrees: tuple[int, ...]
    error: float

    def growth(self, points: ArrayLike) -> Array:
        """Factors by which the parts at each point, shape (k, n), grow from degree to degree.

        Below 1 the series converges there, above it does not; shape (k,).
        """
        parts = self.series.parts(np.asarray(points, dtype=np.float64))
        factors = np.zeros(parts.shape[1])
        for d in self.degrees:
            size = np.linalg.norm(parts[d], axis=-1)
            np.maximum(factors, (size / (self.scale * d**self.power)) ** (1.0 / d), out=factors)
        return factors

    def outside(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Mark points of a trajectory, shape (k, n), outside or within ``error`` of the edge.

        There the series does not converge, or so slowly that it is of no use.
        """
        return self.growth(points) >= 1.0 - self.error


def convergence(series: PolynomialMap) -> Convergence:
    """Estimate where a series converges."""
    sizes = part_norms(series)
    degrees = _degrees(sizes)
    if not degrees:
        return Convergence(series, np.inf, 1.0, 0.0, (), 0.0)
    if len(degrees) < LEAST_PARTS:
        raise InputError(
            "degree",
            f"{series.degree} leaves {len(degrees)} parts with terms from degree {degrees[0]} on, "
            f"must leave {LEAST_PARTS} for an estimate of the radius of convergence",
        )
    scale, power, radius = _fit(degrees, sizes)
    others = [_fit(some, sizes)[2] for some in (degrees[1:], degrees[:-1])]
    spread = abs(others[1] - others[0]) / radius
    if spread > _MAX_SPREAD:
        raise InputError(
            "degree",
            f"{series.degree} is too low for an estimate of the radius of convergence: "
            f"{others[0]:.3g} without the lowest part and {others[1]:.3g} without the highest",
        )
    error = max(_LEAST_ERROR, 4.0 * spread)
    return Convergence(series, radius, scale, power, tuple(degrees), error)


def _degrees(sizes: Array) -> list[int]:
    """The upper half of the degrees, those whose parts are more than rounding."""
    present = [d for d in range(1, len(sizes)) if sizes[d] > 0]
    if len(present) < 2:
        return []
    # In a unit in which the first two parts are of one size, what is much smaller is rounding.
    first, second = present[:2]
    unit = (sizes[first] / sizes[second]) ** (1.0 / (second - first))
    scaled = sizes * unit ** np.arange(len(sizes))
    start = max(2, len(sizes) // 2)
    return [d for d in present if d >= start and scaled[d] > _NOTHING * scaled[present].max()]


def _fit(degrees: list[int], sizes: Array) -> tuple[float, float, float]:
    """C, c and R of C d^c / R^d."""
    d = np.array(degrees, dtype=np.float64)
    columns = np.stack([np.ones_like(d), np.log(d), -d], axis=1)
    fit, *_ = np.linalg.lstsq(columns, np.log(sizes[degrees]), rcond=None)
    return float(np.exp(fit[0])), float(fit[1]), float(np.exp(fit[2]))


def part_norms(series: PolynomialMap) -> Array:
    """Bombieri's norm of each homogeneous part, shape (degree + 1,)."""
    basis = as_kind("series", series, PolynomialMap).basis
    table = np.abs(series.coefficients.astype(np.float64)) ** 2
    norms = []
    for d in range(series.degree + 1):
        exponents = basis.exponents[basis.part(d)]
        weights = [np.prod([float(factorial(power)) for power in m]) for m in exponents.tolist()]
        norms.append(np.sqrt(np.sum(table[:, basis.part(d)] * weights) / factorial(d)))
    return np.array(norms)


def warning(domain: Convergence, states: ArrayLike, step: float) -> str | None:
    """A sentence if a trajectory, a point every ``step`` seconds, leaves the domain, or None."""
    growth = domain.growth(states)
    outside, edge = growth >= 1.0, domain.outside(states)
    if not edge.any():
        return None
    first = int(np.argmax(edge)) * step
    return (
        f"the series converges up to a radius of {domain.radius:.3g} or little beyond; of the "
        f"samples of the trajectory {100 * float(np.mean(outside)):.3g} % are outside and "
        f"{100 * float(np.mean(edge & ~outside)):.3g} % within {100 * domain.error:.2g} % of the "
        f"edge, the first at t = {first:g} s, where a higher order need not be better"
    )
