"""Covariances of noise and of states, decided in units in which all variances are one.

Units of signals may differ by many orders, so that the largest entry of a covariance is no measure
of its others. The correlation matrix, P_ij / sqrt(P_ii P_jj), is the same in all units.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_floats, as_matrix

Array = NDArray[np.float64]

# How far from symmetric a correlation matrix may be, and how far below zero its eigenvalues.
# Rounding makes a product like R J R^T asymmetric by about n 2e-16.
_ROUNDING = 1e-12
_DEFINITE = 4e-16  # times their number: what the eigenvalues of definite ones are above

_LISTED = 9  # eigenvalues of larger matrices are not listed in messages


def as_covariance(name: str, value: ArrayLike, size: int, *, definite: bool = False) -> Array:
    """A covariance from a number (times identity), a diagonal or the matrix itself.

    A matrix that is symmetric but for rounding is made symmetric.

    Raises
    ------
    InputError
        If it has another size, is not symmetric, has a negative variance, or its correlation matrix
        has an eigenvalue below zero by more than rounding; or with ``definite`` one of these that
        is not above zero.
    """
    matrix = as_matrix(name, value, size)
    if not size:
        return matrix
    if _are_good(matrix[None], definite)[0]:
        return matrix
    variances, scaled = np.diag(matrix), _correlations(matrix[None])[0]
    if (variances > 0).all() or not np.count_nonzero(scaled[variances == 0]):
        with np.errstate(invalid="ignore"):
            if not np.abs(scaled - scaled.T).max() <= _ROUNDING:
                raise InputError(name, f"{shown(matrix.tolist())} must be symmetric")
        matrix = 0.5 * matrix + 0.5 * matrix.T  # a sum of halves does not overflow
        if _are_good(matrix[None], definite)[0]:
            return matrix
    eigenvalues, i = np.linalg.eigvalsh(matrix), int(np.argmin(variances))
    problem = f"its eigenvalues are {_listed(eigenvalues)}"
    if eigenvalues[0] <= (0.0 if definite else -_ROUNDING * eigenvalues[-1]):
        pass  # which says it all
    elif size > 1 and (variances[i] < 0 or (definite and variances[i] == 0)):
        problem += f", and the variance at [{i}, {i}] is {variances[i]:g}"
    elif np.isfinite(scaled).all() and (variances > 0).all():
        problem += f", and those of its correlation matrix {_listed(np.linalg.eigvalsh(scaled))}"
    elif np.count_nonzero(matrix[variances == 0]):
        problem += f", and beside the variance of 0 at [{i}, {i}] there are covariances"
    if definite and name.partition("[")[0] == "R" and (variances == 0).any():
        problem += "; what is exact to a digit d has a variance of d^2 / 12"
    wanted = "definite" if definite else "semidefinite"
    raise InputError(name, f"must be positive {wanted}, {problem}")


def _listed(eigenvalues: Any) -> str:
    if len(eigenvalues) > _LISTED:
        return f"from {eigenvalues[0]:g} to {eigenvalues[-1]:g}"
    return ", ".join(f"{value:g}" for value in eigenvalues)


def as_positive_definite(name: str, value: ArrayLike | Any, size: int) -> Array:
    """A positive definite matrix, as definite covariances are, of one row or more."""
    matrix = as_covariance(name, value, size, definite=True)
    if not size:
        raise InputError(name, "is empty, must have one row or more")
    return matrix


def as_covariances(
    name: str, value: ArrayLike, size: int, rows: int, *, definite: bool = False
) -> Array:
    """A covariance as `as_covariance` makes it, shape (1, n, n), or one for each row, (k, n, n).

    Of one number, those of rows may be (k,).

    Raises
    ------
    InputError
        If it is neither; it names the first row that is no such covariance.
    """
    array = as_floats(name, value)
    if size == 1 and array.shape == (rows,):
        array = array[:, None, None]
    if array.ndim != 3:
        return as_covariance(name, array, size, definite=definite)[None]
    if array.shape != (rows, size, size):
        wanted = (rows, size, size)
        raise InputError(name, f"has shape {array.shape}, must be one covariance or {wanted}")
    for row in np.flatnonzero(~_are_good(array, definite)):
        array[row] = as_covariance(f"{name}[{row}]", array[row], size, definite=definite)
    return np.ascontiguousarray(array)


def _are_good(matrices: Array, definite: bool) -> Any:
    """True for matrices, (k, n, n), that are covariances as they stand, symmetric to the bit."""
    variances = matrices.diagonal(axis1=1, axis2=2)
    good = (variances > 0 if definite else variances >= 0).all(axis=1)
    good &= (matrices == matrices.transpose(0, 2, 1)).all(axis=(1, 2))
    diagonal = matrices.shape[1] == 1 or not np.count_nonzero(
        matrices - variances[:, :, None] * np.eye(matrices.shape[1])
    )
    if diagonal or not good.any():
        return good
    scaled = _correlations(matrices)
    good &= np.isfinite(scaled).all(axis=(1, 2))
    least = np.linalg.eigvalsh(np.where(good[:, None, None], scaled, 1.0))[:, 0]
    good &= least > matrices.shape[1] * _DEFINITE if definite else least >= -_ROUNDING
    return good


def _correlations(matrices: Array) -> Array:
    """P_ij / sqrt(P_ii P_jj), 0 where both are 0, else inf or nan where a variance is zero."""
    deviations = np.sqrt(np.abs(matrices.diagonal(axis1=1, axis2=2)))
    with np.errstate(all="ignore"):
        scaled = matrices / deviations[:, :, None] / deviations[:, None, :]
    scaled[(matrices == 0.0)] = 0.0
    return scaled
