"""Elimination inside compiled loops, against exact fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from reobserve.core.small_systems import solve_in_place


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_solution_of_a_whole_system_is_exact_to_rounding(n: int) -> None:
    """Whole numbers, some of them zeros on the diagonal, so that rows must be exchanged."""
    rng = np.random.default_rng(n)
    for _ in range(20):
        matrix = rng.integers(-4, 5, (n, n)).astype(float)
        if n > 1:
            matrix[0, 0] = 0.0
        if abs(np.linalg.det(matrix)) < 0.5:
            continue
        wanted = [Fraction(int(k), 7) for k in rng.integers(-9, 10, n)]
        rows = [[Fraction(int(each)) for each in row] for row in matrix]
        right = np.array(
            [float(sum(a * x for a, x in zip(row, wanted, strict=True))) for row in rows]
        )
        solve_in_place(matrix, right)
        assert right == pytest.approx([float(each) for each in wanted], rel=1e-11, abs=1e-13)


def test_small_pivot_is_not_used() -> None:
    """1e-20 as the first pivot would lose the second equation."""
    right = np.array([1.0, 2.0])
    solve_in_place(np.array([[1e-20, 1.0], [1.0, 1.0]]), right)
    assert right == pytest.approx([1.0, 1.0], rel=1e-15)


def test_singular_system_has_no_finite_solution() -> None:
    right = np.array([1.0, 2.0])
    solve_in_place(np.array([[1.0, 2.0], [2.0, 4.0]]), right)
    assert not np.isfinite(right).all()
