"""Derivatives from the samples so far: exact for polynomials, of the stated order, the same in
pieces.
"""

from __future__ import annotations

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve.observers.row_derivatives import Array, as_signal_rows, completed, latest


def found(values: Array, order: int, period: float, cut: int | None = None) -> Array:
    """The completed rows of a record, or of its two parts."""
    recent, known, last, rows = np.zeros(order + 1), 0, None, []
    for part in np.split(values, [] if cut is None else [cut]):
        _, full, _, _ = completed(
            part[:, None], None, None, recent=recent, known=known, last=last, period=period
        )
        recent, known, last = latest(recent, part), known + len(part), full[-1]
        rows.append(full)
    return np.concatenate(rows)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_derivatives_are_exact_for_polynomials_of_the_next_degree(order: int) -> None:
    period, time = 0.25, 0.25 * np.arange(12)
    polynomial = np.polynomial.Polynomial(np.arange(1.0, order + 3))
    truth = np.stack([polynomial.deriv(i)(time) for i in range(order + 1)], axis=1)
    rows = found(truth[:, 0], order, period)
    assert rows[order + 1 :] == pytest.approx(truth[order + 1 :], rel=1e-10)
    assert np.array_equal(rows[:, 0], truth[:, 0])
    # At the second sample a line is fitted; the first one takes its slope.
    assert rows[1, 1] == pytest.approx((truth[1, 0] - truth[0, 0]) / period, rel=1e-12)
    assert np.array_equal(rows[0, 1:], rows[1, 1:])
    assert not rows[1, 2:].any()


@pytest.mark.parametrize("order", [1, 2])
def test_errors_fall_with_the_period_as_stated(order: int) -> None:
    periods, worst = np.array([0.1, 0.05, 0.025]), []
    for period in periods:
        time = period * np.arange(round(5 / period))
        quarter = np.arange(order + 1) * np.pi / 2
        truth = np.sin(time[:, None] + quarter)
        rows = found(truth[:, 0], order, period)
        worst.append(np.abs(rows - truth)[order + 1 :, 1:].max(axis=0))
    slopes = np.polyfit(np.log(periods), np.log(worst), 1)[0]
    assert slopes == pytest.approx(order + 2 - np.arange(1, order + 1), abs=0.15)


def test_noise_on_a_sample_is_amplified_as_stated() -> None:
    steps = found(np.eye(7)[3], 1, 0.01)[3:6, 1]
    assert steps == pytest.approx([150.0, -200.0, 50.0])
    assert np.linalg.norm(steps) == pytest.approx(2.55 / 0.01, rel=1e-2)


@pytest.mark.parametrize("cut", [2, 3, 5])
def test_two_consecutive_records_equal_one(cut: int) -> None:
    values = np.random.default_rng(1).normal(size=9)
    assert np.array_equal(found(values, 2, 0.1, cut), found(values, 2, 0.1))


def test_slope_of_the_first_interval_comes_from_the_second_sample() -> None:
    values = np.array([[1.0], [3.0]])
    _, whole, _, _ = completed(
        values, None, None, recent=np.zeros(2), known=0, last=None, period=0.5
    )
    last, second, _, _ = completed(
        values[1:], None, None, recent=np.array([0.0, 1.0]), known=1, last=np.array([1.0, 0.0]),
        period=0.5,
    )  # fmt: skip
    assert last is not None
    assert last.tolist() == whole[0].tolist() == [1.0, 4.0]
    assert second[0].tolist() == whole[1].tolist() == [3.0, 4.0]


def test_limits_and_midpoints_have_the_signal_without_derivatives() -> None:
    rows = np.array([[0.0], [2.0], [4.0], [9.0]])
    before, middle = rows - 0.5, rows - 1.0
    _, full, left, inside = completed(
        rows, before, middle, recent=np.zeros(2), known=0, last=None, period=1.0
    )
    assert left[:, 0].tolist() == before[:, 0].tolist()
    assert np.array_equal(left[:, 1:], full[:, 1:])
    assert inside is not None
    assert inside[:, 0].tolist() == middle[:, 0].tolist()
    assert np.array_equal(inside[1:, 1], 0.5 * (full[1:, 1] + full[:-1, 1]))


def test_a_record_has_all_derivatives_or_none() -> None:
    whole = np.arange(12.0).reshape(4, 3)
    assert np.array_equal(as_signal_rows("y", whole, 2), whole)
    assert np.array_equal(as_signal_rows("y", whole[:, :1], 2), whole[:, :1])
    assert np.array_equal(as_signal_rows("y", whole[:, 0], 2), whole[:, :1])
    for columns in (2, 4):
        with pytest.raises(InputError, match=r"must have 3 columns, a signal and its derivatives"):
            as_signal_rows("y", np.zeros((4, columns)), 2)
