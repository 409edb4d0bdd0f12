"""Columns of dates at once, bitwise as `reobserve.estimation.clock` reads and spells each of them.

Functions return None where they are not certain to; dates are then read and spelled one by one.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.estimation.clock import Dates
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dates import SECOND, of_nanoseconds, offset_of, time_zone

Array = NDArray[np.float64]
Whole = NDArray[np.int64]

_MICROSECONDS = 10**6  # in a second
_HOUR = timedelta(hours=1)
_EXACT = 2**53  # whole numbers up to it are floats
_FARTHEST = 9e9  # [s] from 1970, which 64 bits hold in nanoseconds
_DIRECTIVES = {
    "Y": r"\d{4}", "m": r"\d{2}", "d": r"\d{2}", "H": r"\d{2}", "M": r"\d{2}", "S": r"\d{2}",
    "f": r"\d{1,9}", "%": "%",
}  # fmt: skip


def read(columns: Sequence[Any], dates: Dates, report: DataReport) -> Array | None:
    """The times [s] of columns of texts, which pyarrow has, or None."""
    import pyarrow as pa
    import pyarrow.compute as compute

    columns = [column.cast(pa.string()) for column in columns]
    if dates.day or not len(columns[0]) or any(column.null_count for column in columns):
        return None
    written = compute.binary_join_element_wise(*columns, " ") if columns[1:] else columns[0]
    texts = _as_iso(written, dates.format) if dates.format else written
    parsed = None if texts is None else _nanoseconds(texts)
    if parsed is None:
        return None
    ticks, floating = parsed[0] // 1000, parsed[1]
    if floating and dates.zone:
        offsets = _offsets(ticks, dates.zone, True)
        if offsets is None:
            return None
        ticks = ticks - offsets
    try:  # the first one, as this also says which zone and origin there are
        first = dates.nanoseconds(written[0].as_py(), report)
    except ValueError:
        return None
    report.since_origin(first)
    assert report.origin is not None
    past = ticks - report.origin * _MICROSECONDS
    if first != int(ticks[0]) * 1000 or np.abs(past).max() > _EXACT:
        return None
    report.latest = int(ticks[-1])
    return np.asarray(past / _MICROSECONDS)


def _nanoseconds(texts: Any) -> tuple[Whole, bool] | None:
    """Nanoseconds since 1970 of texts by ISO 8601, all of them with an offset, or all without."""
    import pyarrow as pa

    for zone in ("UTC", None):
        with suppress(pa.ArrowException):  # where some have an offset and others none, always
            return numbers(texts.cast(pa.timestamp("ns", zone)).cast(pa.int64())), zone is None
    return None


def numbers(column: Any) -> Any:
    """A column as numpy, nan for null, as ``to_numpy`` would import pandas to look at it."""
    import pyarrow as pa
    import pyarrow.compute as compute

    if column.null_count:
        nan = pa.Array.from_buffers(pa.float64(), 1, [None, pa.py_buffer(np.array([np.nan]))])
        column = compute.fill_null(column, nan[0])
    return np.from_dlpack(column if hasattr(column, "offset") else column.combine_chunks())


def _as_iso(texts: Any, form: str) -> Any:
    """Texts by a format of digits alone as ISO 8601 has them, or None."""
    import pyarrow.compute as compute

    pattern, names = "", list[str]()
    for directive, letter in re.findall(r"%(.)|([^%])", form, re.DOTALL):
        if directive and directive not in _DIRECTIVES:
            return None
        if not directive or directive == "%":
            pattern += re.escape(letter or "%")
        else:
            milli = directive == "f" and pattern[-1:] not in (".", ",")  # and not a fraction
            names.append(directive)
            pattern += r"(\d{3,9})" if milli else f"({_DIRECTIVES[directive]})"
    if len(set(names)) < len(names) or not {"Y", "m", "d"} <= set(names):
        return None
    time = [name for name in "HMS" if name in names]
    if time != list("HMS")[: len(time)] or ("f" in names and len(time) < 3):
        return None
    if not compute.all(compute.match_substring_regex(texts, f"^{pattern}$")).as_py():
        return None
    at = {name: f"\\{names.index(name) + 1}" for name in names}
    iso = f"{at['Y']}-{at['m']}-{at['d']}"
    if time:
        iso += "T" + (":".join(at[name] for name in time) if time[1:] else f"{at['H']}:00")
    iso += f".{at['f']}" if "f" in names else ""
    return compute.replace_substring_regex(texts, f"^{pattern}$", iso)


def _offsets(ticks: Whole, zone: str, local: bool) -> Whole | None:
    """Offsets [us] of a zone's clocks at times [us since 1970], ``local`` ones or of UTC.

    None if clocks are changed within the hour of one of them.
    """
    clocks = time_zone(zone)
    hours, which = np.unique(ticks // (3600 * _MICROSECONDS), return_inverse=True)
    by_hour = np.empty(len(hours), dtype=np.int64)
    for k, hour in enumerate(hours.tolist()):
        begin = of_nanoseconds(hour * 3600 * SECOND)
        ends = (begin, begin + _HOUR - timedelta(microseconds=1))
        dates: list[datetime] = [end.astimezone(clocks) for end in ends]
        if local:
            dates = [end.replace(tzinfo=clocks, fold=fold) for end in ends for fold in (0, 1)]
        offsets = {date.utcoffset() or timedelta() for date in dates}
        if len(offsets) > 1:
            return None
        by_hour[k] = offsets.pop() // timedelta(microseconds=1)
    return np.asarray(by_hour[which])


def of_timestamps(column: Any, dates: Dates, report: DataReport) -> Array:
    """Times [s] of a column of dates as Parquet has them, without an offset or of UTC."""
    import pyarrow as pa
    import pyarrow.compute as compute

    floating = getattr(column.type, "tz", None) is None
    kind = pa.timestamp("ns", None if floating else column.type.tz)
    ticks = compute.fill_null(column.cast(kind).cast(pa.int64()), 0)
    timestamps = ticks.to_numpy(zero_copy_only=False)
    known = column.is_valid().to_numpy(zero_copy_only=False)
    if not known.any():
        return np.full(len(known), np.nan)
    if floating and dates.zone:
        timestamps = timestamps.copy()
        offsets = _offsets(timestamps[known] // 1000, dates.zone, True)
        if offsets is not None:
            timestamps[known] -= offsets * 1000
        else:
            for k in np.flatnonzero(known):
                date = of_nanoseconds(int(timestamps[k])).replace(tzinfo=None)
                timestamps[k] = dates.local(date, report) + timestamps[k] % 1000
                report.latest = int(timestamps[k]) // 1000
    dates.floating = dates.floating or (floating and not dates.zone)
    report.zone = dates.zone or ("" if floating else str(column.type.tz))
    report.clock(int(timestamps[known.argmax()]))
    report.latest = int(timestamps[known][-1]) // 1000
    assert report.origin is not None
    return np.where(known, (timestamps - report.origin * SECOND) / SECOND, np.nan)


def ticks_of(times: Array, report: DataReport) -> Whole | None:
    """Dates at times [s] in micro- or nanoseconds since 1970, by the digits of the report."""
    assert report.origin is not None
    if not len(times) or np.abs(times).max() + abs(report.origin) > _FARTHEST:
        return None
    unit = 1000 if report.digits == 6 else 1
    past: Whole = np.rint(times * SECOND / unit).astype(np.int64)
    return report.origin * (SECOND // unit) + past


def spelled(times: Array, report: DataReport) -> Any:
    """Texts of dates at times [s], as `DataReport.stamp` spells them, in pyarrow, or None."""
    import pyarrow as pa
    import pyarrow.compute as compute

    ticks = ticks_of(times, report)
    if ticks is None:
        return None
    part = SECOND if report.digits == 9 else _MICROSECONDS  # of a second
    clocks, offset = ticks, "Z" if report.zone == "UTC" else ""
    if report.zone not in ("", "UTC"):
        offsets = _offsets(ticks // (part // _MICROSECONDS), report.zone, False)
        if offsets is None or (offsets != offsets[0]).any():
            return None
        clocks = ticks + offsets * (part // _MICROSECONDS)
        first = of_nanoseconds(int(ticks[0]) * (SECOND // part))
        offset = offset_of(first.astimezone(time_zone(report.zone)))
    kind = pa.timestamp("ns" if report.digits == 9 else "us")
    texts = compute.replace_substring(pa.array(clocks, kind).cast(pa.string()), " ", "T")
    if report.period % 1.0 == 0.0:
        whole = pa.array(ticks % part == 0)
        texts = compute.if_else(whole, compute.utf8_slice_codeunits(texts, 0, 19), texts)
    return compute.binary_join_element_wise(texts, offset, "") if offset else texts
