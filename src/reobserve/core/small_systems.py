"""Small linear equations inside compiled loops."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import kernel

Array = NDArray[np.float64]


@kernel
def solve_in_place(matrix: Array, right: Array) -> None:
    """Gaussian elimination with partial pivoting, whose solution replaces ``right``.

    ``matrix``, shape (n, n), is used up. A singular one gives inf or nan, as a division does.
    """
    n = len(right)
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > abs(matrix[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(k, n):
                matrix[k, j], matrix[pivot, j] = matrix[pivot, j], matrix[k, j]
            right[k], right[pivot] = right[pivot], right[k]
        for i in range(k + 1, n):
            factor = matrix[i, k] / matrix[k, k]
            for j in range(k + 1, n):
                matrix[i, j] -= factor * matrix[k, j]
            right[i] -= factor * right[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            right[k] -= matrix[k, j] * right[j]
        right[k] /= matrix[k, k]
