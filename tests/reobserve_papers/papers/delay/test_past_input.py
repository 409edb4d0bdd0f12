"""The past of an input between its samples, and its ends."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from reobserve_papers.papers.delay.estimator_loop import past_input

Array = NDArray[np.float64]


def sine(time: Array) -> Array:
    return np.stack([np.sin(3 * time), 3 * np.cos(3 * time)], axis=1)


def samples(signal: Callable[[Array], Array], step: float, steps: int) -> Array:
    """A record of this many steps, the last of which ends at zero."""
    return signal(0.5 * step * np.arange(-2 * steps, 1))


def at(inputs: Array, ago: Array, step: float) -> Array:
    """The input this long before the end."""
    last = len(inputs) - 3
    return np.array([past_input(inputs, last, 1.0, back / step, step) for back in ago])


def test_interpolation_is_of_orders_six_and_five() -> None:
    ago = np.linspace(0, 2, 4001)
    errors = [
        np.max(np.abs(at(samples(sine, 2 / steps, steps), ago, 2 / steps) - sine(-ago)), axis=0)
        for steps in (10, 20, 40)
    ]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(np.abs(orders - [6, 5]) < 0.15)


def test_polynomial_of_degree_five_is_exact() -> None:
    p = np.polynomial.Polynomial([0.3, -1, 0.5, 2, -0.7, 0.4])

    def signal(time: Array) -> Array:
        return np.stack([p(time), p.deriv()(time)], axis=1)

    ago = np.linspace(0, 2, 101)
    found = at(samples(signal, 0.5, 4), ago, 0.5)
    assert np.allclose(found, signal(-ago), rtol=0, atol=1e-12)


def test_position_in_the_arrays_does_not_change_a_bit() -> None:
    long = samples(sine, 0.1, 50)
    for now in (20, 60, 98):
        window = long[now - 20 : now + 3]
        assert past_input(long, now, 0.5, 7.3, 0.1) == past_input(window, 20, 0.5, 7.3, 0.1)


def test_extrapolation_covers_one_step_and_indices_stay_in_bounds() -> None:
    past = samples(sine, 0.01, 10)
    last = len(past) - 3
    for lag, time in ((10.4, -0.104), (-0.4, 0.004)):  # steps before the end
        u, rate = past_input(past, last, 1.0, lag, 0.01)
        assert abs(u - np.sin(3 * time)) < 1e-9
        assert abs(rate - 3 * np.cos(3 * time)) < 1e-6
    far = [past_input(past, last, 1.0, lag, 0.01) for lag in (11, 1e6, 1e300)]
    assert far[0] == far[1] == far[2]
    for lag in (np.nan, np.inf, -np.inf):
        assert np.isnan(past_input(past, last, 1.0, lag, 0.01)).all()
