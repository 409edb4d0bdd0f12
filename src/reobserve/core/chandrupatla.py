"""Root of a function of one variable by Chandrupatla's method.

T. R. Chandrupatla, A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear
function without using derivatives, Advances in Engineering Software 28, 1997. The inverse
parabola through three points where it can be trusted, else a bisection: seven or eight trials
where the function is smooth.
"""

from __future__ import annotations

import math

from reobserve.core.kernel import kernel

Point = tuple[float, float]  # where, and the function there


@kernel
def next_trial(newest: Point, opposite: Point, former: Point, distance: float) -> float:
    """The next place to look, between ``newest`` and ``opposite``, at which the signs differ.

    ``former`` is the point that one of them took the place of, at first ``newest`` itself.
    From both it keeps ``distance``: two not twice as far from each other are as near as asked.
    """
    (a, at_a), (b, at_b), (c, at_c) = newest, opposite, former
    share = 0.5
    place, level = (a - b) / (c - b), (at_a - at_b) / (at_c - at_b)
    if 1.0 - math.sqrt(1.0 - place) < level < math.sqrt(place):
        share = at_a / (at_b - at_a) * at_c / (at_b - at_c)
        share += (c - a) / (b - a) * at_a / (at_c - at_a) * at_b / (at_c - at_b)
    least = distance / abs(b - a)
    return a + min(max(share, least), 1.0 - least) * (b - a)
