"""Frames and series of pandas as records: columns by their names, and an index of times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from reobserve.core.errors import InputError, nearest, shown
from reobserve.observers.record import depth_of

UNEVEN = 0.01  # of the sampling period: how much longer or shorter the time between rows may be


def run_other(
    observer: Any, y: Any, u: Any, state: Any, time: Any, before: Any, middle: Any, loud: bool,
    given: Any,
) -> Any:  # fmt: skip
    """`Observer.run` of what is no record of arrays: made one, and frames and dates put back."""
    if (np.ndim(y) if isinstance(y, np.ndarray) else depth_of(y)) == 3:
        for name, pair in (("before", before), ("middle", middle)):
            if pair is not None:
                raise InputError(name, "must be left out with many records")
        from reobserve.observers.many_records import run_many

        return run_many(observer, y, u, state, time, loud, given)
    y, u, before, middle, time, index = read_frames(observer, y, u, before, middle, time)
    counted, start = index is not None and time is None, state
    if counted and state is not None:
        observer._read(y, u, before, middle, given)  # what is wrong with these is said first
        start = state = observer._checked(state)
        if state.time is not None:
            _check_index(observer, index, state.time)
            state = replace(state, time=None)
    run = observer._run_record(y, u, state, time, before, middle, loud, given)
    if index is None:
        return run
    after = run.end
    if counted and run.diverged_at is None:
        after = replace(after, time=float(as_seconds("y", index[-1:])[0]))
    elif counted and start is not None:
        after = start
    return replace(run, end=after, index=index[: len(run)])


def read_frames(
    observer: Any, y: Any, u: Any, before: Any, middle: Any, time: Any
) -> tuple[Any, Any, Any, Any, Any, Any]:
    """The arguments with columns in the order of the model's signals, and the index of y.

    Times become seconds, of dates those since 1970. The index is None where y has none, or a plain
    count of rows.

    Raises
    ------
    InputError
        If columns have other names than the model's signals, an index of times does not go on by
        the sampling period and no times are given, or y and u have different ones.
    """
    time = as_seconds("time", time)
    if type(y) is np.ndarray and (u is None or type(u) is np.ndarray) and before is middle is None:
        return y, u, None, None, time, None
    indices = {name: _index(value) for name, value in (("y", y), ("u", u))}
    y, u = _arranged(observer, "y", y), _arranged(observer, "u", u)
    before, middle = (
        _arranged_pair(observer, name, pair)
        for name, pair in (("before", before), ("middle", middle))
    )
    if time is None:
        for name, labels in indices.items():
            if labels is not None:
                _compare(name, labels, observer.sampling_period)
    index, other = (None if _kind(each) in "iu" else each for each in indices.values())
    if index is not None and other is not None and len(index) == len(other):
        differ = np.flatnonzero(~np.asarray(index == other))
        if differ.size:
            row = int(differ[0])
            problem = f"has {shown(str(other[row]))} in the index of row {row}, y {index[row]}"
            raise InputError("u", problem)
    return y, u, before, middle, time, index


def read_rows(observer: Any, y: Any, u: Any, before: Any, middle: Any) -> tuple[Any, Any, Any, Any]:
    """Samples with their entries in the order of the model's signals, if they have names."""
    pairs = (("before", before), ("middle", middle))
    early, half = (_arranged_pair(observer, name, pair, row=True) for name, pair in pairs)
    y, u = (_arranged(observer, name, value, row=True) for name, value in (("y", y), ("u", u)))
    return y, u, early, half


PLAIN = (np.ndarray, list, float, type(None))


def _check_index(observer: Any, index: Any, last: float) -> None:
    """Refuse an index that does not go on from the time [s] of a state."""
    first, period = float(as_seconds("y", index[:1])[0]), observer.sampling_period
    if abs(first - last - period) > max(UNEVEN * period, 4 * np.spacing(first)):
        raise InputError(
            "y", f"has an index that begins at {index[0]}, {first - last:.9g} s after the last row "
            f"of the state, must go on by the sampling period of {period:g} s"
            f"{observer._uneven_hint or '; for other times give time'}",
        )  # fmt: skip


def as_seconds(name: str, time: Any) -> Any:
    """Dates as seconds since 1970 and lengths of time as seconds, anything else as it is."""
    if _kind(time) not in "MmO" or time is None:
        return time
    if hasattr(time, "to_timestamp"):
        time = time.to_timestamp()
    values = np.asarray(time)
    if getattr(getattr(time, "dtype", None), "tz", None) is not None:  # else objects
        values = np.asarray(time, dtype="datetime64[ns]")
    if values.dtype.kind not in "Mm":
        return time
    if np.isnat(values).any():
        raise InputError(name, f"is not known at row {int(np.argmax(np.isnat(values)))}")
    whole, part = np.divmod(values.astype(f"{values.dtype.kind}8[ns]").astype(np.int64), 10**9)
    return whole + 1e-9 * part


def _kind(value: Any) -> str:
    kind = getattr(getattr(value, "dtype", None), "kind", None)
    return kind if isinstance(kind, str) else "-"


def _arranged_pair(observer: Any, name: str, pair: Any, row: bool = False) -> Any:
    """A pair of y and u, arranged, or what is none as it is."""
    if not isinstance(pair, tuple | list) or len(pair) != 2:
        return pair
    return tuple(
        _arranged(observer, f"{name} {signal}", value, row)
        for signal, value in zip("yu", pair, strict=True)
    )


def _arranged(observer: Any, name: str, value: Any, row: bool = False) -> Any:
    """A frame, or with ``row`` a series or numbers by name, in the order of the model's signals."""
    named = row and isinstance(value, Mapping)
    if type(value) in PLAIN or not (named or hasattr(value, "iloc")):
        return value
    if row or hasattr(value, "columns"):
        model = getattr(getattr(observer, "filters", [observer])[0], "model", None)
        kind = "output" if name.endswith("y") else "input"
        signals = getattr(model, f"{kind}_names", None)
        if named:
            return _by_name(name, value, signals or (), kind)
        value = _in_order(name, value, signals)
    return _without_na(value)


def _by_name(name: str, value: Mapping[Any, Any], signals: Sequence[str], kind: str) -> list[Any]:
    """The numbers of a sample, with nan for measurements that are not named."""
    for wrong in value.keys() - set(signals):
        raise InputError(name, f"{shown(wrong)} names no {kind}{nearest(str(wrong), signals)}")
    for signal in signals if kind == "input" else ():
        if signal not in value:
            raise InputError(name, f"has no entry {signal}, must have {', '.join(signals)}")
    return [value.get(signal, np.nan) for signal in signals]


def _without_na(value: Any) -> Any:
    """Columns that may hold NA as floats with nan in its place."""
    if all(isinstance(kind, np.dtype) for kind in np.atleast_1d(np.asarray(value.dtypes, object))):
        return value
    try:
        return value.to_numpy(np.float64, na_value=np.nan)
    except (TypeError, ValueError):  # which the loops' check names
        return value


def _index(value: Any) -> Any:
    """The index of a frame or series, if it is of times: dates, lengths of time or numbers.

    One of whole numbers is a count of rows, or of time in whatever unit.
    """
    index: Any = getattr(value, "index", None)
    if hasattr(index, "to_timestamp"):  # of periods
        index = index.to_timestamp()
    return index if _kind(index) in "Mmfiu" and len(index) == len(value) else None


def _names(value: Any) -> list[str] | None:
    """The names of columns, or of the entries of a series, or None if they are not all texts."""
    names = list(getattr(value, "columns", value.index))
    return names if names and all(isinstance(name, str) for name in names) else None


def _in_order(name: str, value: Any, signals: Sequence[str] | None) -> Any:
    names = _names(value)
    if not names or not signals or names == list(signals):
        return value
    missing = [signal for signal in signals if signal not in names]
    if missing:
        kind = "column" if hasattr(value, "columns") else "entry"
        problem = f"has no {kind} {missing[0]}, must have {', '.join(signals)}"
        raise InputError(name, problem + nearest(missing[0], names))
    return value[list(signals)]


def _compare(name: str, index: Any, period: float) -> None:
    """Refuse an index of times that does not go on by the sampling period, a count by its step."""
    kind = _kind(index)
    if kind in "iu":
        steps, unit = np.diff(index.to_numpy()), "equal steps"
        off = (steps == steps[:1]) & (steps > 0)
    else:
        unit = f"the sampling period of {period:g} s"
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
            f"must go on by {unit}; else give time",
        )  # fmt: skip
