"""Root search against known roots and against scipy's implementation."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import elementwise

from reobserve.core.chandrupatla import next_trial

Array = NDArray[np.float64]

APART = 2.0**-50
SMOOTH: dict[str, tuple[Callable[[float], float], float]] = {
    "cubic": (lambda x: x**3 - 0.2, 0.2 ** (1 / 3)),
    "exponential": (lambda x: math.exp(-3.0 * x) - 0.25, math.log(4.0) / 3.0),
    "tangent": (lambda x: math.tan(1.2 * x) - 1.0, math.pi / 4.8),
}
HARD: dict[str, tuple[Callable[[float], float], float]] = {
    "kink": (lambda x: min(1e-3 - x, 50.0 * (2e-3 - x)), 1e-3),
    "jump": (lambda x: 1.0 if x < 0.7 else -1e-9, 0.7),
    "flat": (lambda x: math.copysign((0.6 - x) ** 8, 0.6 - x), 0.6),
    "at the start": (lambda x: -x, 0.0),
    "an end that is no number": (lambda x: 0.2 - x if x < 0.5 else math.nan, 0.2),
}


def trials(function: Callable[[float], float]) -> list[float]:
    """All points in [0, 1] at which a function is evaluated, the ends first."""
    newest, opposite = (0.0, function(0.0)), (1.0, function(1.0))
    former, places = newest, [0.0, 1.0]
    while abs(newest[0] - opposite[0]) > 2.0 * APART:
        here = next_trial(newest, opposite, former, APART)
        assert min(newest[0], opposite[0]) < here < max(newest[0], opposite[0])
        places.append(here)
        if (function(here) >= 0.0) == (newest[1] >= 0.0):
            former = newest
        else:
            former, opposite = opposite, newest
        newest = here, function(here)
    assert (newest[1] >= 0.0) != (opposite[1] >= 0.0)
    return places


def trials_of_scipy(function: Callable[[float], float]) -> list[float]:
    """The points that scipy evaluates, 0 and 1 first, without the final one."""
    places: list[float] = []

    def noted(rows: Array) -> Array:
        places.extend(np.ravel(rows).tolist())
        return np.array([function(x) for x in np.ravel(rows)]).reshape(np.shape(rows))

    assert elementwise.find_root(noted, (0.0, 1.0), tolerances={"xatol": 1e-4}).success
    return places[:-1]


@pytest.mark.parametrize("name", SMOOTH)
def test_search_evaluates_the_same_points_as_scipy(name: str) -> None:
    function, where = SMOOTH[name]
    places, known = trials(function), trials_of_scipy(function)
    assert places[-1] == pytest.approx(where, abs=1e-15)
    assert len(known) > 5
    assert places[: len(known)] == pytest.approx(known, abs=1e-9)
    assert len(places) <= 12


@pytest.mark.parametrize("name", HARD)
def test_sign_change_is_found_where_interpolation_fails(name: str) -> None:
    function, where = HARD[name]
    places = trials(function)
    assert places[-1] == pytest.approx(where, abs=2.0 * APART)
    assert len(places) <= 51  # as many as a bisection
