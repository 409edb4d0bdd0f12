"""Frames and series of pandas as records: columns by their names, and an index of times."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from reobserve.core.errors import InputError, shown

UNEVEN = 0.01  # of the sampling period: how much longer or shorter the time between rows may be


def read_frames(observer: Any, y: Any, u: Any, timed: bool) -> tuple[Any, Any, Any]:
    """y and u with their columns in the order of the model's signals, and the index of y.

    ``timed`` says that the times of the rows are given beside them. The index is None where y has
    none, or a plain count of rows.

    Raises
    ------
    InputError
        If columns have other names than the model's signals, an index of times does not go on by
        the sampling period, or y and u have different ones.
    """
    if type(y) is np.ndarray and (u is None or type(u) is np.ndarray):
        return y, u, None
    index, other = _index(y), _index(u)
    if index is None and other is None and not (_columns(y) or _columns(u)):
        return y, u, None
    filters = getattr(observer, "filters", [observer])
    model = getattr(filters[0], "model", None)  # of which some observers have none
    y = _in_order("y", y, getattr(model, "output_names", None))
    u = _in_order("u", u, getattr(model, "input_names", None))
    for name, one in (("y", index), ("u", other)):
        if one is not None and not timed:
            _compare(name, one, observer.sampling_period)
    if index is not None and other is not None and len(index) == len(other):
        differ = np.flatnonzero(~np.asarray(index == other))
        if differ.size:
            row = int(differ[0])
            problem = f"has {shown(str(other[row]))} in the index of row {row}, y {index[row]}"
            raise InputError("u", problem)
    return y, u, index


def _index(value: Any) -> Any:
    """The index of a frame or series, if it is of times: dates, lengths of time or numbers."""
    index: Any = getattr(value, "index", None)
    kind = getattr(getattr(index, "dtype", None), "kind", "")
    return index if kind in ("M", "m", "f") and len(index) == len(value) else None


def _columns(value: Any) -> list[str] | None:
    """The names of the columns of a frame, or None if they are not all texts."""
    columns = getattr(value, "columns", None)
    if columns is None or not hasattr(value, "index"):
        return None
    names = list(columns)
    return names if names and all(isinstance(name, str) for name in names) else None


def _in_order(name: str, value: Any, signals: Sequence[str] | None) -> Any:
    columns = _columns(value)
    if not columns or not signals or columns == list(signals):
        return value
    if sorted(columns) != sorted(signals):
        problem = f"has the columns {', '.join(columns)}, must have {', '.join(signals)}"
        raise InputError(name, problem)
    return value[list(signals)]


def _compare(name: str, index: Any, period: float) -> None:
    """Refuse an index of times that does not go on by the sampling period."""
    kind = index.dtype.kind
    if kind == "f":
        seconds = index.to_numpy(np.float64)
    else:
        timestamps = index.to_numpy("datetime64[ns]" if kind == "M" else "timedelta64[ns]")
        seconds = (timestamps - timestamps[:1]) / np.timedelta64(1, "ns") * 1e-9
    off = np.abs(np.diff(seconds) - period) <= UNEVEN * period
    if not off.all():
        row = int(np.argmin(off)) + 1
        raise InputError(
            name, f"has an index that goes from {index[row - 1]} to {index[row]} at row {row}, "
            f"must go on by the sampling period of {period:g} s; else give time",
        )  # fmt: skip
