"""Derivatives by differences, where the size of a state or of a function is not one."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from reobserve import ExtendedKalmanFilter, NonlinearModel

CASES: dict[str, tuple[Callable[[Any], Any], float, float]] = {
    "sine of micrometres": (lambda x: math.sin(x[0] / 1e-7), 3e-8, 1e7 * math.cos(0.3)),
    "reciprocal": (lambda x: 1.0 / x[0], -2e-10, -2.5e19),
    "saturation": (lambda x: math.tanh(x[0] / 1e-5), -1e-5, 1e5 / math.cosh(1.0) ** 2),
    "quadratic drag": (lambda x: x[0] * abs(x[0]), 3e-6, 6e-6),
    "root at the end of its domain": (lambda x: math.sqrt(x[0]), 4e-8, 2500.0),
    "logarithm": (lambda x: math.log(x[0]), 1e-7, 1e7),
    "angle of many turns": (lambda x: math.sin(x[0]), 1000.3, math.cos(1000.3)),
    "offset beside a small slope": (lambda x: 7.0 + math.sin(x[0]), 1e-3, math.cos(1e-3)),
}


@pytest.mark.nightly_cases("0.001-offset beside a small slope", "0.001-logarithm")
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("deviation", [1e-3, 1e3])
def test_derivative_fits_the_size_of_the_state(case: str, deviation: float) -> None:
    h, x, slope = CASES[case]
    model = NonlinearModel(lambda x: x, h, 0.0, 1e-60, F=lambda x: [[1.0]], states=1, outputs=1)
    kalman = ExtendedKalmanFilter(model)
    run = kalman.run([h([x])], start=kalman.init([x], deviation**2))
    # S = (dh/dx)^2 P
    found = math.sqrt(run["innovation_covariance"][0, 0, 0]) / deviation
    assert found == pytest.approx(abs(slope), rel=1e-9)


def test_step_at_a_jump_stays_as_it_is() -> None:
    """No step is short enough for sign(x): the slope is that over the first one."""

    def sign(x: Any) -> float:
        return 1.0 if x[0] > 0 else -1.0

    model = NonlinearModel(lambda x: x, sign, 0.0, 1.0, F=lambda x: [[1.0]], states=1, outputs=1)
    kalman = ExtendedKalmanFilter(model)
    run = kalman.run([0.0], start=kalman.init([0.0], 1.0))
    assert 1.0 < run["innovation_covariance"][0, 0, 0] < 1e7
