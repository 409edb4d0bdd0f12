"""Results as files, whole or not at all: CSV, gzipped if its name says so, and Parquet."""

from __future__ import annotations

import gzip
import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.core.files import write_whole
from reobserve.estimation import date_columns
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.estimate import Estimated
from reobserve.estimation.gaps import STATUSES

Array = NDArray[np.float64]

_ENDINGS = (".csv", ".csv.gz", ".parquet")
KEY = b"reobserve estimate"
_MOST_DIGITS = 17  # with which any number reads back to the same
_AT_ONCE = 2**15  # rows of text in memory
_FEW = 50  # rows, for which a column at a time is not worth while
_SMALL, _LARGE = 1e-4, 1e9  # numbers between them are spelled by all in one way


def check_name(path: Path) -> None:
    """Refuse a name that says no format."""
    if not str(path).endswith(_ENDINGS):
        raise InputError(str(path), f"must end with {', '.join(_ENDINGS)}")


def check_digits(digits: int | None, path: Path | None) -> None:
    """Refuse a number of digits that results cannot have."""
    if digits is None:
        return
    if not 1 <= digits <= _MOST_DIGITS:
        problem = f"{digits} must be a whole number from 1 to {_MOST_DIGITS}"
        raise InputError("--digits", problem)
    if path is not None and path.suffix == ".parquet":
        problem = f"is for text, such as .csv; {path.name} has all digits"
        raise InputError("--digits", problem)


def line(
    time: str,
    numbers: Sequence[float],
    alarms: Sequence[float],
    status: int,
    digits: int | None = None,
) -> str:
    """A row of text, with nan as nothing.

    Numbers have so many significant digits, or the shortest form that reads back to the same.
    """
    cells = [time, *_cells(numbers, digits)]
    cells += [str(int(value)) if value == value else "" for value in alarms]  # noqa: PLR0124
    cells.append(STATUSES[status])
    return ",".join(cells) + "\n"


def _cells(numbers: Sequence[float], digits: int | None) -> list[str]:
    if digits is None:
        return [repr(value) if value == value else "" for value in numbers]  # noqa: PLR0124
    form = f".{digits}g"
    return [format(value, form) if value == value else "" for value in numbers]  # noqa: PLR0124


def header(titles: Sequence[str]) -> str:
    """The first line."""
    stream = io.StringIO()
    import csv

    csv.writer(stream, lineterminator="\n").writerow(titles)
    return stream.getvalue()


def text(block: Estimated, report: DataReport, digits: int | None = None) -> str:
    """A block of rows as text."""
    if len(block.time) > _FEW:
        return _text(block, report, digits)
    times = map(report.stamp, block.time.tolist())
    rows = zip(
        times, block.numbers.tolist(), block.alarms.tolist(), block.status.tolist(), strict=True
    )
    return "".join(line(*row, digits) for row in rows)


def _text(block: Estimated, report: DataReport, digits: int | None) -> str:
    """The same by pyarrow, a column at a time."""
    import pyarrow as pa
    import pyarrow.compute as compute

    times = None
    if report.origin is not None:
        times = date_columns.spelled(block.time, report)
    elif not report.shift:
        times = _column(block.time, None)
    if times is None:
        times = pa.array(list(map(report.stamp, block.time.tolist())))
    ends = pa.array([status + "\n" for status in STATUSES])
    rows = compute.binary_join_element_wise(
        times,
        *(_column(numbers, digits) for numbers in block.numbers.T),
        *(_whole(numbers) for numbers in block.alarms.T),
        ends.take(pa.array(block.status)),
        ",",
    )
    whole = pa.ListArray.from_arrays(pa.array([0, len(rows)], pa.int32()), rows)
    return str(compute.binary_join(whole, "")[0])


def _column(numbers: Array, digits: int | None) -> Any:
    """Numbers as `_cells` spells them: pyarrow does, where they have all digits, in one way."""
    import pyarrow as pa
    import pyarrow.compute as compute

    if digits is not None:
        return pa.array(_cells(numbers.tolist(), digits), pa.string())
    sizes = np.abs(numbers)
    other = ~((sizes >= _SMALL) & (sizes < _LARGE) & (sizes != np.rint(sizes)))
    cells = pa.array(_cells(numbers[other].tolist(), None), pa.string())
    return compute.replace_with_mask(pa.array(numbers).cast(pa.string()), pa.array(other), cells)


def _whole(numbers: Array) -> Any:
    import pyarrow as pa
    import pyarrow.compute as compute

    whole = pa.array(numbers, from_pandas=True).cast(pa.int64()).cast(pa.string())
    return compute.fill_null(whole, "")


def write_results(
    path: Path,
    titles: Sequence[str],
    blocks: Iterator[Estimated],
    about: Callable[[], Mapping[str, Any]],
    report: DataReport,
    digits: int | None = None,
) -> None:
    """Write blocks as they come, in a format by `check_name`, and ask ``about`` after the last.

    Times are those of the ``report``, numbers in text have as many ``digits`` as `line` writes.
    """

    def csv(partial: Path) -> None:
        with ExitStack() as open_files:
            stream: Any = open_files.enter_context(partial.open("wb"))
            if path.suffix == ".gz":  # without a name and a time: the same rows are the same file
                stream = open_files.enter_context(
                    gzip.GzipFile(filename="", fileobj=stream, mode="wb", mtime=0)
                )
            stream.write(header(titles).encode())
            for block in blocks:
                for begin in range(0, len(block.time), _AT_ONCE):
                    rows = Estimated._make(part[begin : begin + _AT_ONCE] for part in block)
                    stream.write(text(rows, report, digits).encode())

    def parquet(partial: Path) -> None:
        package("pyarrow", "write Parquet files")
        from pyarrow.parquet import ParquetWriter

        with ExitStack() as open_files:
            writer: Any = None
            for block in blocks:
                table = as_columns(block, titles, report)
                if writer is None:  # as the first rows say what times are
                    writer = open_files.enter_context(ParquetWriter(partial, table.schema))
                writer.write_table(table)
            writer.add_key_value_metadata({KEY: json.dumps(about()).encode()})

    write_whole(path, parquet if path.suffix == ".parquet" else csv)


def as_times(times: Array, report: DataReport) -> Any:
    """Times [s] as a column of pyarrow: dates, or seconds of the record's own clock."""
    import pyarrow as pa

    if report.origin is None:
        return pa.array(times + (report.shift or 0))
    dates: Any = date_columns.ticks_of(times, report)
    if dates is None:
        unit = 1000 if report.digits == 6 else 1
        dates = [report.nanoseconds(seconds) // unit for seconds in times.tolist()]
    return pa.array(dates, pa.timestamp("us" if report.digits == 6 else "ns", report.zone or None))


def as_columns(block: Estimated, titles: Sequence[str], report: DataReport) -> Any:
    """A block of rows as a table of pyarrow."""
    import pyarrow as pa

    numbers = np.column_stack([block.numbers, block.alarms])
    status = pa.array(STATUSES, pa.string()).take(pa.array(block.status))
    cells = [pa.array(column, pa.float64(), from_pandas=True) for column in numbers.T]
    return pa.table([as_times(block.time, report), *cells, status], list(titles))
