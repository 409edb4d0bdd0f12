"""Periods of signals that are angles, after which they are the same again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.matrices import as_floats, as_numbers, as_positive

Array = NDArray[np.float64]
_WHOLE = 1e-9
Periods = Mapping[str, float] | Sequence[float | None]


def as_periods(key: str, value: Any, size: int, names: Sequence[str] | None) -> Array | None:
    """The periods of signals, shape (size,), zero where there is none, or None for none at all.

    Parameters
    ----------
    key
        The name of the argument.
    value
        A list of ``size`` positive numbers, or None where a signal has no period; or numbers by the
        names of signals.
    size, names
        Of the signals.
    """
    if value is None:
        return None
    if isinstance(value, Mapping):
        known = tuple(names or ())
        for name in value:
            if name not in known:
                problem = f"{shown(name)} is no name of a signal{nearest(str(name), known)}"
                raise InputError(key, problem)
        value = [value.get(name) for name in known]
    given = value.tolist() if type(value) is np.ndarray and value.shape == (size,) else value
    if not isinstance(given, list | tuple) or len(given) != size:
        raise InputError(key, f"{shown(value)} must be a list of {size} periods, None for none")
    periods = np.zeros(size)
    for place, period in enumerate(given):
        if period is not None and period != 0:  # as this function itself writes none
            periods[place] = as_positive(f"{key}[{place}]", period)
    return periods if periods.any() else None


def check_period_of_effects(
    key: str, matrices: Array, periods: Array | None, of_rows: Array | None
) -> None:
    """Refuse a matrix by which an angle has another effect after a period.

    Parameters
    ----------
    key
        The name of the matrix.
    matrices
        Shape (m, n), or (k, m, n).
    periods
        Of what it is multiplied with, (n,); None if there are no angles.
    of_rows
        Of what it gives, (m,), or None.

    Raises
    ------
    InputError
        If an entry times a period is no whole number of periods of its row.
    """
    if periods is None:
        return
    rows = np.zeros(matrices.shape[-2]) if of_rows is None else of_rows
    with np.errstate(over="ignore", invalid="ignore"):  # of numbers that are wrong
        effects = matrices * periods  # (..., m, n)
        turns = effects / np.where(rows > 0, rows, np.inf)[:, None]
        left = np.where(rows[:, None] > 0, turns - np.round(turns), effects)
        wrong = ~(np.abs(left) <= _WHOLE)
    if wrong.any():
        *_, row, column = np.argwhere(wrong)[0].tolist()
        what = f"row {row + 1}, column {column + 1} times the period {periods[column]:g}"
        period = f"{rows[row]:g}, its row's" if rows[row] > 0 else "0, as its row has no period"
        raise InputError(key, f"{what} must be a whole multiple of {period}")


def wrapped(values: ArrayLike, periods: ArrayLike) -> Array:
    """Values, or differences of them, moved by whole periods to within half of one around zero.

    Parameters
    ----------
    values
        Shape (..., n).
    periods
        Shape (n,), or one number; zero where there is none.

    Raises
    ------
    InputError
        If they are no numbers, or the periods have another shape or are not finite.

    Examples
    --------
    >>> from reobserve.systems.periods import wrapped
    >>> print(wrapped([350.0, -200.0, 10.0], 360.0))
    [-10. 160.  10.]
    """
    angles, period = as_numbers("values", values, writable=False), as_floats("periods", periods)
    if period.shape not in ((), angles.shape[-1:]):
        raise InputError("periods", f"has shape {period.shape}, must be (), or that of a value")
    with np.errstate(invalid="ignore", over="ignore"):
        turns = np.floor(angles / np.where(period > 0, period, np.inf) + 0.5)
    return np.asarray(angles - period * np.nan_to_num(turns, posinf=0.0, neginf=0.0))
