"""Where the series of S converges, with 80 digits, and an injection that improves the error."""

from __future__ import annotations

from functools import cache

import mpmath
import numpy as np
import pytest
from mpmath import mpf
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from tests.reobserve_papers.papers.lie.test_floquet import van_der_pol_cycle

Array = NDArray[np.float64]

A = ((-2, 1), (-5, 1))
Part = list[tuple[mpf, mpf]]  # of x1^(d - k) x2^k for each k


def part_of_s(d: int, before: Part, cubic: tuple[float, float]) -> Part:
    """The part of S of a degree, from S' F x - A S = x1^2 x2 dS/dx2 - l(x1), l cubic.

    With rows (k I - A) s_k + (d - k + 1) s_{k-1} - (k + 1) s_{k+1} it is block tridiagonal.
    """
    driven = [(k * a, k * b) for k, (a, b) in enumerate(before)] + [(mpf(0), mpf(0))] * 2
    if d == 3:
        driven[0] = (driven[0][0] - cubic[0], driven[0][1] - cubic[1])
    forward: list[tuple[mpmath.matrix, mpmath.matrix]] = []  # s_k = M s_{k+1} + v
    for k in range(d + 1):
        pivot = mpmath.matrix([[k - A[0][0], -A[0][1]], [-A[1][0], k - A[1][1]]])
        right = mpmath.matrix(driven[k])
        if forward:
            pivot += (d - k + 1) * forward[-1][0]
            right -= (d - k + 1) * forward[-1][1]
        inverse = mpmath.matrix([[pivot[1, 1], -pivot[0, 1]], [-pivot[1, 0], pivot[0, 0]]])
        inverse /= pivot[0, 0] * pivot[1, 1] - pivot[0, 1] * pivot[1, 0]
        forward.append(((k + 1) * inverse, inverse * right))
    last = forward[d][1]
    found = [last]
    for M, v in reversed(forward[:d]):
        last = M * last + v
        found.append(last)
    return [(one[0], one[1]) for one in reversed(found)]


@cache
def sizes_on_the_cycle(cubic: tuple[float, float]) -> dict[int, float]:
    """Root mean square of each part of S over the limit cycle."""
    with mpmath.workdps(80):
        points = [(mpf(a), mpf(b)) for a, b in van_der_pol_cycle().points(24)]
        part: Part = [(mpf(1), mpf(0)), (mpf(0), mpf(1))]
        found = {}
        for d in range(3, 122, 2):
            part = part_of_s(d, part, cubic)
            if d % 20 == 1:
                squares = [
                    sum(p[i] * a ** (d - k) * b**k for k, p in enumerate(part)) ** 2
                    for a, b in points
                    for i in range(2)
                ]
                found[d] = float(mpmath.sqrt(sum(squares) / len(points)))
    return found


@pytest.mark.nightly_cases("cubic1")
@pytest.mark.parametrize("cubic", [(0.0, 0.0), (0.2, -0.7)])
def test_domain_of_the_series_of_s_ends_at_the_limit_cycle(cubic: tuple[float, float]) -> None:
    """Along the backward orbit S is analytic inside; on the cycle it is not, but converges.

    There the error falls as the distance to the power 0.5 / 1.0594, the rate of A over the exponent
    of the cycle, so that the parts of S fall as d^-1.472.
    """
    sizes = sizes_on_the_cycle(cubic)
    edges = [(sizes[d - 20] / sizes[d]) ** (1 / 20) for d in (41, 81, 121)]
    assert edges == sorted(edges, reverse=True)
    assert 1.03 < edges[0] < 1.06  # which the figure draws, from degree 41
    assert 1.0 < edges[2] < 1.014
    slope = np.log(sizes[121] / sizes[101]) / np.log(121 / 101)
    assert slope == pytest.approx(-(1 + 0.5 / 1.0594), abs=0.08)


def measures(start: tuple[float, float], cubic: float) -> Array:
    """Integrals of the squared and the absolute error, and when it is 2 % of that of Fig. 1."""

    def f(x: Array) -> Array:
        return np.array([x[1], -x[0] + x[1] - x[0] ** 2 * x[1]])

    def rate(_: float, z: Array) -> Array:
        fed = np.array([-2.0, -4.0]) * (z[2] - z[0]) + cubic * (z[2] ** 3 - z[0] ** 3)
        return np.concatenate([f(z[:2]), f(z[2:]) + fed])

    time = np.linspace(0, 12, 1201)
    run = solve_ivp(rate, (0, 12), [*start, 0, 0], t_eval=time, rtol=1e-7, atol=1e-9)
    error = np.hypot(*(run.y[2:] - run.y[:2]))
    settled = time[np.nonzero(error > 0.02 * np.hypot(2, 0.5))[0][-1]]
    return np.array([np.trapezoid(error**2, time), np.trapezoid(error, time), settled])


def test_injection_with_a_cubic_term_improves_convergence_of_the_error() -> None:
    """The identity form of order 0 with l(y) = L0 y - 0.5 y^3 (1, 1), against the constant gain."""
    figure = measures((2.0, 0.5), -0.5)
    assert figure == pytest.approx([1.293, 0.983, 1.26], rel=0.01)
    for start in [(2.0, 0.5), (-3.0, 2.0), (1.0, -3.0), (0.0, 1.0), (3.0, 3.0)]:
        assert np.all(measures(start, -0.5) < measures(start, 0.0))
