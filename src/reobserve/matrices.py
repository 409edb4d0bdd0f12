"""Checks of matrix parameters that plants, observers and synthesis share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import InputError

Matrix = NDArray[np.float64]


def as_floats(name: str, value: ArrayLike | Any) -> NDArray[np.float64]:
    """``value`` as an array of finite floats; `InputError` names ``name`` otherwise."""
    try:
        raw = np.array(value)
    except ValueError:  # rows of different lengths
        raw = np.array(None)
    if raw.dtype.kind not in "iuf":
        raise InputError(name, f"{value!r} is not a number or an array of numbers")
    array = raw.astype(np.float64)
    if not np.all(np.isfinite(array)):
        raise InputError(name, f"{array.tolist()} has an entry that is not finite")
    return array


def as_scalar(name: str, value: Any) -> float:
    """``value`` as one finite float; `InputError` names ``name`` otherwise."""
    array = as_floats(name, value)
    if array.ndim != 0:
        raise InputError(name, f"{value!r} must be one number, not an array of shape {array.shape}")
    return float(array)


def as_positive(name: str, value: Any) -> float:
    """``value`` as one finite float above zero; `InputError` names ``name`` otherwise."""
    number = as_scalar(name, value)
    if number <= 0:
        raise InputError(name, f"{number:g} must be greater than zero")
    return number


def as_vector(name: str, value: ArrayLike | Any, size: int) -> Matrix:
    """``value`` as a vector of ``size`` finite floats; `InputError` names ``name`` otherwise."""
    array = as_floats(name, value)
    if array.shape != (size,):
        raise InputError(name, f"has shape {array.shape}, must be a list of {size} numbers")
    return array


def as_matrix(name: str, value: ArrayLike | Any, size: int) -> Matrix:
    """A square matrix from a number (times identity), a diagonal or the matrix itself.

    Raises
    ------
    InputError
        If ``value`` is none of: a number, ``size`` numbers, ``size`` rows of ``size`` numbers.
    """
    array = as_floats(name, value)
    if array.ndim == 0:
        return np.eye(size) * float(array)
    if array.shape == (size,):
        return np.diag(array)
    if array.shape == (size, size):
        return array
    raise InputError(
        name,
        f"has shape {array.shape}, must be one number (times the identity), "
        f"{size} numbers (a diagonal) or a {size} x {size} matrix",
    )


def as_positive_definite(name: str, value: ArrayLike | Any, size: int) -> Matrix:
    """`as_matrix`, and symmetric positive definite; `InputError` gives the eigenvalues if not."""
    matrix = as_matrix(name, value, size)
    if not np.array_equal(matrix, matrix.T):
        raise InputError(name, f"{matrix.tolist()} must be symmetric")
    eigenvalues = np.linalg.eigvalsh(matrix)
    if eigenvalues[0] <= 0:
        listed = ", ".join(f"{value:g}" for value in eigenvalues)
        raise InputError(name, f"must be positive definite, its eigenvalues are {listed}")
    return matrix


def as_rows(name: str, value: ArrayLike, like: Matrix | None = None) -> Matrix:
    """``value`` of shape (samples, n), the shape of ``like`` if that is given."""
    array = as_floats(name, value)
    if array.ndim != 2 or (like is not None and array.shape != like.shape):
        wanted = "(samples, n)" if like is None else like.shape
        raise InputError(name, f"has shape {array.shape}, must be {wanted}")
    return array


def as_record(
    name: str,
    samples: ArrayLike,
    columns: int,
    rows: int | None = None,
    like: str = "the measured rate",
) -> Matrix:
    """What an observer reads: two samples a step, and one at the end; finite, contiguous.

    Raises
    ------
    InputError
        If there is no odd number of rows (``rows`` if given, as ``like`` has), 3 or more, of
        ``columns`` finite numbers.
    """
    try:
        array = np.ascontiguousarray(samples, dtype=np.float64)
    except (TypeError, ValueError):  # text, or rows of different lengths
        raise InputError(name, "is no array of numbers") from None
    if array.ndim != 2 or array.shape[1] != columns or len(array) % 2 == 0 or len(array) < 3:
        raise InputError(
            name,
            f"has shape {array.shape}, must have an odd number of rows, 3 or more, of {columns} "
            f"number{'s' if columns > 1 else ''}",
        )
    if rows is not None and len(array) != rows:
        raise InputError(name, f"has {len(array)} rows, must have {rows} like {like}")
    # Rows are looked at one by one only if something is wrong: that costs as much as observing.
    if not np.isfinite(array).all():
        row = int(np.argmin(np.isfinite(array).all(axis=1)))
        raise InputError(name, f"sample {row} is {array[row].tolist()}, must be finite")
    return array


def spectral_radius(matrix: Matrix) -> float:
    """The largest absolute eigenvalue of a square matrix."""
    return float(np.max(np.abs(np.linalg.eigvals(matrix))))
