"""Checks of matrix parameters that plants, observers and synthesis share."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import MOST_STATES
from reobserve.core.errors import InputError, shown


class _FromLists:
    """Rule by which pydantic makes an array of floats of a number or of nested lists."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        from pydantic_core import core_schema

        return core_schema.no_info_plain_validator_function(lambda value: as_floats("", value))

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> Any:
        return {"type": ["number", "array"]}


FloatArray = Annotated[NDArray[np.float64], _FromLists()]
"""An array of finite floats, as a field of what files declare."""

Matrix = FloatArray

# Of arrays with more entries a message tells the shape alone.
_SHOWN = 9

_DOUBLE = np.dtype(np.float64)  # the one object of this type in native order

MOST_BYTES = 2**30  # of an array that is copied
_MOST_SPREAD = 10**7  # numbers that need memory only when they are used

_FEW = 24  # entries that Python looks at sooner than numpy is called, as each step of an observer


def as_numbers(name: str, value: ArrayLike | Any, *, writable: bool = True) -> NDArray[np.float64]:
    """``value`` as compiled loops take arrays: of 64-bit floats, C-contiguous and writable.

    Whatever holds real numbers will do: lists, arrays of other types and orders, read-only ones,
    frames and series of pandas. An array that is as it should be is handed back, not copied; for
    another kind each kernel would be compiled again. Entries need not be finite. With ``writable``
    false a read-only array will do, which is for no loop.

    Raises
    ------
    InputError
        If it is no number and no array of numbers: text, booleans, complex numbers, objects, rows
        of different lengths, masked entries.
    """
    if type(value) is np.ndarray and value.dtype is _DOUBLE:
        flags = value.flags
        if flags.carray or (not writable and flags.c_contiguous and flags.aligned):
            return value
    if _has_other(value):
        raise InputError(name, _no_numbers(value))
    try:
        array = value if isinstance(value, range) else np.asarray(value)
        if _is_spread(array):
            raise MemoryError
        array = np.asarray(array)
        if array.dtype is _DOUBLE and array.flags.carray:
            return array
        if array.dtype.kind not in "iuf":
            raise TypeError
        return np.require(array, np.float64, ["C", "A", "W"])
    except MemoryError:
        shape = (len(value),) if isinstance(value, range) else getattr(value, "shape", None)
        which = f"of shape {shape} " if shape else ""
        raise InputError(name, f"{which}is too large for memory") from None
    except Exception:  # rows of different lengths, too many of them, or an object's own error
        raise InputError(name, _no_numbers(value)) from None


def _is_spread(value: Any) -> bool:
    """True for many numbers that are not all in memory: a range or a broadcast array."""
    if not isinstance(value, np.ndarray):
        return isinstance(value, range) and len(value) > _MOST_SPREAD
    steps = zip(value.shape, value.strides, strict=True)
    return value.size > _MOST_SPREAD and (
        sum((size - 1) * abs(stride) for size, stride in steps) + value.itemsize < value.nbytes
    )


def _no_numbers(value: Any) -> str:
    why = _why(value)
    return (
        f"{shown(value)}{f', where {why},' if why else ''} is not a number or an array of numbers"
    )


def _why(value: Any) -> str:
    """The first entry that is no number, and the dtype, or nothing if there is no such entry."""
    try:
        if _is_spread(value):
            return "it is too large for memory"
        own = np.asanyarray(value)
        if np.ma.is_masked(own):
            return f"the entry {np.argwhere(np.ma.getmaskarray(own))[0].tolist()} is masked"
        entries = np.asarray(value, dtype=object)
        kind = "" if isinstance(value, list | tuple) else f" and the dtype {own.dtype}"
        if entries.ndim:
            for place, entry in np.ndenumerate(entries):
                other = isinstance(entry, bool | np.bool_)
                if other or not isinstance(entry, int | float | np.integer | np.floating):
                    return f"the entry {list(place)} is {shown(entry)}{kind}"
        return "the dtype is object" if entries.ndim and own.dtype == object else ""
    except Exception:  # rows of different lengths, or an object's own error
        return ""


def _has_other(value: Any) -> bool:
    """True if numpy would take what is no number for one: masked entries, booleans in a list."""
    if isinstance(value, np.ndarray):
        return isinstance(value, np.ma.MaskedArray) and bool(np.ma.is_masked(value))
    if isinstance(value, list | tuple):
        return any(not isinstance(entry, float) and _has_other(entry) for entry in value)
    return isinstance(value, bool | np.bool_)


def all_finite(array: NDArray[np.float64]) -> bool:
    """True if all entries are finite."""
    if array.size <= _FEW:
        return all(map(math.isfinite, array.ravel().tolist()))
    return bool(np.isfinite(array).all())


def as_floats(name: str, value: ArrayLike | Any) -> NDArray[np.float64]:
    """``value`` as an array of its own of finite floats. `InputError` names ``name`` otherwise."""
    array = as_numbers(name, value)
    if array.nbytes > MOST_BYTES:
        raise InputError(name, f"of shape {array.shape} is too large for memory, above 1 GiB")
    if not np.all(np.isfinite(array)):
        place = shown(array.tolist()) if array.size <= _SHOWN else shown(array)
        raise InputError(name, f"{place} has an entry that is not finite")
    return array.copy() if array is value or array.base is not None else array


def as_sized(name: str, value: ArrayLike | Any) -> NDArray[np.float64]:
    """``value`` as `as_floats` makes it, with at most `MOST_STATES` entries along each axis."""
    array = as_floats(name, value)
    if max(array.shape, default=0) > MOST_STATES:
        raise InputError(
            name, f"has shape {array.shape}, must be at most {MOST_STATES} along each axis"
        )
    return array


def as_scalar(name: str, value: Any) -> float:
    """``value`` as one finite float. `InputError` names ``name`` otherwise."""
    array = as_floats(name, value)
    if array.ndim != 0:
        raise InputError(
            name, f"{shown(value)} must be one number, not an array of shape {array.shape}"
        )
    return float(array)


def as_positive(name: str, value: Any) -> float:
    """``value`` as one finite float above zero. `InputError` names ``name`` otherwise."""
    number = as_scalar(name, value)
    if number <= 0:
        raise InputError(name, f"{number:g} must be greater than zero")
    return number


def as_vector(name: str, value: ArrayLike | Any, size: int) -> Matrix:
    """``value`` as a vector of ``size`` finite floats. `InputError` names ``name`` otherwise."""
    array = as_floats(name, value)
    if array.shape != (size,):
        ending = "s" if size != 1 else ""
        raise InputError(name, f"has shape {array.shape}, must be a list of {size} number{ending}")
    return array


@np.errstate(over="ignore")  # the sum is then not one
def as_probabilities(name: str, value: ArrayLike | Any, size: int) -> Matrix:
    """``value`` as ``size`` probabilities that sum to 1. `InputError` names ``name`` otherwise."""
    array = as_vector(name, value, size)
    if array.min() < 0 or abs(array.sum() - 1.0) > 1e-9:
        raise InputError(
            name, f"{shown(array.tolist())} must be 0 or more and sum to 1, not {array.sum():g}"
        )
    return array


def as_row_stochastic(name: str, value: ArrayLike | Any, size: int) -> Matrix:
    """A square matrix with rows that are probabilities, or `InputError` with the first that is not.

    Row i, the chances of what follows i, sums to 1.
    """
    matrix = as_floats(name, value)
    if matrix.shape != (size, size):
        raise InputError(name, f"has shape {matrix.shape}, must be {(size, size)}")
    for i, row in enumerate(matrix):
        as_probabilities(f"{name}[{i}]", row, size)
    return matrix


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


def as_rows(name: str, value: ArrayLike, like: Matrix | None = None) -> Matrix:
    """``value`` of shape (samples, n), the shape of ``like`` if that is given."""
    array = as_floats(name, value)
    if array.ndim != 2 or (like is not None and array.shape != like.shape):
        wanted = "(samples, n)" if like is None else like.shape
        raise InputError(name, f"has shape {array.shape}, must be {wanted}")
    return array


def as_samples(
    name: str,
    samples: ArrayLike,
    columns: int | None,
    *,
    rows: int | None = None,
    like: str = "",
    missing: bool = False,
) -> Matrix:
    """The rows of a record that an observer reads, as `as_numbers` makes them.

    Parameters
    ----------
    columns
        How many numbers a row has; None for a plain list of numbers.
    rows
        How many there must be, if that is known, because ``like`` has so many.
    missing
        A nan stands for a number that was not measured.

    Raises
    ------
    InputError
        If they are not so, or not finite; it names the first row that is not.
    """
    try:
        array = as_numbers(name, samples)
    except InputError:
        why = _why(samples)
        raise InputError(name, f"is no array of numbers{f': {why}' if why else ''}") from None
    shape = array.shape
    wrong = len(shape) != (1 if columns is None else 2) or shape[1:] != (
        () if columns is None else (columns,)
    )
    if wrong or not len(array):
        if columns is None:
            raise InputError(name, f"has shape {shape}, must be a list of 1 sample or more")
        numbers = f"{columns} number{'s' if columns != 1 else ''}"
        raise InputError(name, f"has shape {shape}, must have one row or more of {numbers}")
    if rows is not None and len(array) != rows:
        raise InputError(name, f"has {len(array)} rows, must have {rows} like {like}")
    # Rows are looked at one by one only if something is wrong: that costs as much as observing.
    if all_finite(array):
        return array
    good = np.isfinite(array)
    if missing:
        good |= np.isnan(array)
    if not good.all():
        row = int(np.argmin(good.reshape(len(array), -1).all(axis=1)))
        allowed = "must be finite, or nan if missing" if missing else "must be finite"
        raise InputError(name, f"sample {row} is {shown(array[row].tolist())}, {allowed}")
    return array


def as_sample_rows(
    name: str, value: ArrayLike, columns: int, *, rows: int | None = None, missing: bool = False
) -> Matrix:
    """A record of so many columns, or a plain list of numbers for one column.

    Raises
    ------
    InputError
        If it is none, has another number of rows or, by the first such row, is not finite.
    """
    if columns == 1 and getattr(value, "ndim", None) != 2:
        try:
            array = as_numbers(name, value)
        except InputError:
            array = None
        if array is not None and array.ndim == 1:
            value = array[:, None]
    return as_samples(name, value, columns, rows=rows, like="y", missing=missing)


def as_row(name: str, value: ArrayLike | Any) -> Matrix:
    """One sample as a record of one row, for `as_samples`."""
    if isinstance(value, float):
        return np.array([[value]])
    try:
        return as_numbers(name, value).reshape(1, -1)
    except InputError:
        raise InputError(name, f"{shown(value)} is no array of numbers") from None


def spectral_radius(matrix: Matrix) -> float:
    """The largest absolute eigenvalue of a square matrix."""
    return float(np.max(np.abs(np.linalg.eigvals(matrix))))
