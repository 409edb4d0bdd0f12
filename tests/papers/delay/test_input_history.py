"""The past of an input between its samples, where it jumps, and where it ends."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.papers.delay.input_history import InputHistory, past_input

Array = NDArray[np.float64]


def sine(time: Array) -> Array:
    return np.stack([np.sin(3 * time), 3 * np.cos(3 * time)], axis=1)


def grid(step: float, steps: int) -> Array:
    """The times of a record of so many steps, the last of which ends at zero."""
    return 0.5 * step * np.arange(-2 * steps, 1)


def history(step: float, steps: int) -> InputHistory:
    samples = sine(grid(step, steps))
    return InputHistory(samples, samples, sampling_period=step)


def test_orders_six_and_five() -> None:
    ago = np.linspace(0, 2, 4001)
    errors = [
        np.max(np.abs(history(2 / steps, steps).at(ago) - sine(-ago)), axis=0)
        for steps in (10, 20, 40)
    ]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(np.abs(orders - [6, 5]) < 0.15)


def test_a_polynomial_of_degree_five_is_exact() -> None:
    p = np.polynomial.Polynomial([0.3, -1, 0.5, 2, -0.7, 0.4])
    time = grid(0.5, 4)
    samples = np.stack([p(time), p.deriv()(time)], axis=1)
    ago = np.linspace(0, 2, 101)
    expected = np.stack([p(-ago), p.deriv()(-ago)], axis=1)
    assert np.allclose(
        InputHistory(samples, samples, sampling_period=0.5).at(ago), expected, rtol=0, atol=1e-12
    )


def test_samples_are_met() -> None:
    past = history(0.1, 10)
    assert np.allclose(past.at(-grid(0.1, 10)), past.right, rtol=0, atol=1e-13)


def test_a_jump_between_steps_is_sharp() -> None:
    """Zero up to -1, then 1 + t: value and slope jump, and no step sees the other side."""
    time = grid(0.25, 8)
    right = np.where(time[:, None] >= -1, np.stack([2 + time, np.ones_like(time)], axis=1), 0.0)
    left = np.where(time[:, None] > -1, right, 0.0)
    past = InputHistory(right, left, sampling_period=0.25)
    ago = np.array([1.9, 1.2, 1.0 + 1e-9, 1.0, 1 - 1e-9, 0.9, 0.01])
    after = np.stack([2 - ago, np.ones_like(ago)], axis=1)
    assert np.allclose(past.at(ago), np.where(ago[:, None] > 1, 0.0, after), rtol=0, atol=1e-13)


def test_joined_histories_keep_the_limits_at_the_seam() -> None:
    early = InputHistory(np.zeros((5, 2)), np.zeros((5, 2)), sampling_period=1.0)
    late = np.tile([1.0, 0.0], (3, 1))
    both = early.followed_by(late, late)
    assert both.steps == 3
    assert np.array_equal(both.right[:, 0], [0, 0, 0, 0, 1, 1, 1])
    assert np.array_equal(both.left[:, 0], [0, 0, 0, 0, 0, 1, 1])
    assert np.array_equal(both.latest(1).right[:, 0], [1, 1, 1])
    assert np.array_equal(both.at([0.5, 1.5])[:, 0], [1, 0])


def test_the_place_in_the_arrays_does_not_change_a_bit() -> None:
    long = history(0.1, 50)
    ago = np.linspace(0, 1, 333)
    assert np.array_equal(long.at(ago), long.latest(10).at(ago))
    for now in (20, 60, 98):
        window = long.right[now - 20 : now + 3]
        here = past_input(long.right, long.left, now, 0.5, 7.3, 0.1)
        assert here == past_input(window, window, 20, 0.5, 7.3, 0.1)


def test_outside_it_goes_on_for_one_step_and_no_index_leaves_the_arrays() -> None:
    past = history(0.01, 10)
    last = len(past.right) - 3
    for lag, time in ((10.4, -0.104), (-0.4, 0.004)):  # in steps, before the end
        u, rate = past_input(past.right, past.left, last, 1.0, lag, 0.01)
        assert abs(u - np.sin(3 * time)) < 1e-9
        assert abs(rate - 3 * np.cos(3 * time)) < 1e-6
    far = [past_input(past.right, past.left, last, 1.0, lag, 0.01) for lag in (11, 1e6, 1e300)]
    assert far[0] == far[1] == far[2]
    for lag in (np.nan, np.inf, -np.inf):
        assert np.isnan(past_input(past.right, past.left, last, 1.0, lag, 0.01)).all()


def test_wrong_samples_are_refused() -> None:
    good, bad = np.zeros((5, 2)), np.zeros((5, 2))
    bad[3, 1] = np.nan
    with pytest.raises(InputError, match=r"^right: sample 3 is \[0.0, nan\], must be finite"):
        InputHistory(bad, good, sampling_period=1.0)
    with pytest.raises(InputError, match=r"^left: has 7 rows, must have 5 like right"):
        InputHistory(good, np.zeros((7, 2)), sampling_period=1.0)
    with pytest.raises(InputError, match=r"^right: has shape \(4, 2\), must have an odd number"):
        InputHistory(np.zeros((4, 2)), good, sampling_period=1.0)
    with pytest.raises(InputError, match=r"^sampling_period: 0 must be greater than zero"):
        InputHistory(good, good, sampling_period=0.0)
    past = InputHistory(good, good, sampling_period=1.0)
    with pytest.raises(InputError, match=r"^steps: 3 must be from 1 to the 2 that there are"):
        past.latest(3)
    for ago in ([-0.1], [2.1], 1.0):
        with pytest.raises(InputError, match=r"^ago: must be a list of times from 0 to 2 s"):
            past.at(ago)


def test_a_halved_history_has_the_same_polynomials_and_jumps() -> None:
    draw = np.random.default_rng(3)
    right = draw.normal(size=(13, 2))
    left = right.copy()
    left[4] += 1.0  # it jumps where the second step ends
    history = InputHistory(right, left, sampling_period=0.1)
    finer = history.halved()
    assert (finer.steps, finer.sampling_period) == (12, 0.05)
    ago = np.linspace(0.0, 0.6, 173)
    assert finer.at(ago) == pytest.approx(history.at(ago), abs=1e-11)
    assert np.array_equal(finer.right[::2], right)
    assert np.array_equal(finer.left[::2], left)
