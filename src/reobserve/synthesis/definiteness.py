"""Proofs that a symmetric matrix is negative definite, in ball arithmetic.

An eigenvalue of -1e-17 computed in floating point says nothing about a sign. Here every number is a
ball, a midpoint and a radius that encloses all rounding, and the elimination

    M = L D L^T,      L lower triangular with a diagonal of ones,

proves M < 0 when the balls of all pivots in D lie below zero. A pivot above zero behind negative
ones proves that v^T M v > 0 for some v, and so does the eigenvector that floating point finds, if
the ball of v^T M v lies above zero. Balls that are too wide to tell are computed again with more
digits.

A matrix that comes out of products and sums is best formed in balls, too, in a precision that
leaves the radii negligible: ``with flint.ctx.workprec(400): M = ball_matrix(P) * ...``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.core.matrices import as_floats

if TYPE_CHECKING:
    from flint import arb, arb_mat

_PRECISIONS = (53, 106, 212, 424)  # bits of the midpoints


def ball_matrix(values: ArrayLike) -> arb_mat:
    """Floats as balls of radius zero, shape (rows, columns)."""
    package("flint", "calculate in balls")
    from flint import arb_mat

    array = as_floats("values", values)
    if array.ndim != 2:
        raise InputError("values", f"has shape {array.shape}, must be (rows, columns)")
    return arb_mat(array.tolist())


def prove_negative_definite(matrix: arb_mat | ArrayLike) -> bool | None:
    """Prove that a symmetric matrix M is negative definite (True), or that it is not (False).

    False says that M has an eigenvalue above zero, None that M is singular or its balls too wide.

    Parameters
    ----------
    matrix
        M, shape (n, n): floats, taken as exact, or balls. What is proved holds for every symmetric
        matrix inside the balls. Hand over -M to prove that M is positive definite.

    Raises
    ------
    InputError
        If ``matrix`` is not square, not finite, or not symmetric: entries that mirror each other
        must be equal floats or balls that overlap.
    """
    ctx = package("flint", "prove that a matrix is definite").ctx
    balls = _symmetric(matrix)
    size = balls.nrows()
    middle = np.array([float(entry.mid()) for entry in balls.entries()]).reshape(size, size)
    vector = np.linalg.eigh(middle)[1][:, -1:]
    for bits in _PRECISIONS:
        with ctx.workprec(bits):
            sign = _sign(balls)
            if sign < 0:
                return True
            if sign > 0 or _form(balls, vector) > 0:
                return False
    return None


def is_negative_definite(matrix: arb_mat) -> bool:
    """True if a matrix of balls is proved to be symmetric and negative definite as it is.

    As `prove_negative_definite`, but in the precision of the caller alone.
    """
    return _sign(_symmetric(matrix)) < 0


def _symmetric(matrix: arb_mat | ArrayLike) -> arb_mat:
    """M with balls that enclose the symmetric part of all it may be."""
    from flint import arb_mat, ctx

    balls = matrix if isinstance(matrix, arb_mat) else ball_matrix(matrix)
    rows, columns = balls.nrows(), balls.ncols()
    if rows != columns or rows == 0:
        raise InputError("matrix", f"has shape ({rows}, {columns}), must be square")
    if not all(np.isfinite(float(entry.abs_upper())) for entry in balls.entries()):
        raise InputError("matrix", "has an entry that is not finite, or beyond the float range")
    for i, j in np.ndindex(rows, rows):
        if not balls[i, j].overlaps(balls[j, i]):
            raise InputError(
                "matrix",
                f"has {balls[i, j]} at ({i}, {j}) and {balls[j, i]} at ({j}, {i}), "
                "must be symmetric",
            )
    with ctx.workprec(_PRECISIONS[-1]):
        return (balls + balls.transpose()) / 2


def _sign(balls: arb_mat) -> int:
    """-1 if M is proved negative definite, 1 if it is proved not to be, or 0."""
    rows = balls.tolist()
    for k, pivot_row in enumerate(rows):
        pivot = pivot_row[k]
        if not pivot < 0:
            return 1 if pivot > 0 else 0
        column = [row[k] for row in rows]
        for i in range(k + 1, len(rows)):
            row, factor = rows[i], column[i] / pivot
            for j in range(k + 1, i + 1):
                row[j] -= factor * column[j]
    return -1


def _form(balls: arb_mat, vector: NDArray[np.float64]) -> arb:
    """v^T M v of a column of floats."""
    v = ball_matrix(vector)
    return (v.transpose() * balls * v)[0, 0]
