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

from reobserve.core.errors import InputError
from reobserve.core.extras import package
from reobserve.core.files import write_whole
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.estimate import Estimated
from reobserve.estimation.gaps import STATUSES

_ENDINGS = (".csv", ".csv.gz", ".parquet")
KEY = b"reobserve estimate"


def check_name(path: Path) -> None:
    """Refuse a name that says no format.

    Raises
    ------
    InputError
        If it ends otherwise.
    """
    if not str(path).endswith(_ENDINGS):
        raise InputError(str(path), f"must end with {', '.join(_ENDINGS)}")


def line(time: str, numbers: Sequence[float], alarms: Sequence[float], status: int) -> str:
    """A row of text: numbers in the shortest form that reads back to the same, nan as nothing."""
    cells = [time]
    cells += [repr(value) if value == value else "" for value in numbers]  # noqa: PLR0124
    cells += [str(int(value)) if value == value else "" for value in alarms]  # noqa: PLR0124
    cells.append(STATUSES[status])
    return ",".join(cells) + "\n"


def header(titles: Sequence[str]) -> str:
    """The first line."""
    stream = io.StringIO()
    import csv

    csv.writer(stream, lineterminator="\n").writerow(titles)
    return stream.getvalue()


def text(block: Estimated, report: DataReport) -> str:
    """A block of rows as text."""
    times = map(report.stamp, block.time.tolist())
    rows = zip(
        times, block.numbers.tolist(), block.alarms.tolist(), block.status.tolist(), strict=True
    )
    return "".join(line(*row) for row in rows)


def write_results(
    path: Path,
    titles: Sequence[str],
    blocks: Iterator[Estimated],
    about: Callable[[], Mapping[str, Any]],
    report: DataReport,
) -> None:
    """Write blocks as they come, in a format by `check_name`, and ask ``about`` after the last.

    Times are those of the ``report``.

    Raises
    ------
    InputError
        If the file cannot be written; and whatever making the blocks raises. Then there is none.
    """
    fill = _parquet if path.suffix == ".parquet" else _csv
    write_whole(path, lambda partial: fill(partial, path.suffix, titles, blocks, about, report))


def _csv(
    partial: Path,
    ending: str,
    titles: Sequence[str],
    blocks: Iterator[Estimated],
    about: Any,
    report: DataReport,
) -> None:
    with ExitStack() as open_files:
        stream: Any = open_files.enter_context(partial.open("wb"))
        if ending == ".gz":  # without a name and a time, so that the same rows are the same file
            stream = open_files.enter_context(
                gzip.GzipFile(filename="", fileobj=stream, mode="wb", mtime=0)
            )
        stream.write(header(titles).encode())
        for block in blocks:
            stream.write(text(block, report).encode())


def _parquet(
    partial: Path,
    ending: str,
    titles: Sequence[str],
    blocks: Iterator[Estimated],
    about: Any,
    report: DataReport,
) -> None:
    package("pyarrow", "write Parquet files")
    import pyarrow as pa
    import pyarrow.parquet as parquet

    with ExitStack() as open_files:
        writer: Any = None
        for block in blocks:
            kinds = [pa.float64()] * (len(titles) - 1) + [pa.string()]
            if report.origin is None:
                time = pa.array(block.time + (report.shift or 0))
            else:
                kinds[0] = pa.timestamp("us" if report.digits == 6 else "ns", report.zone or None)
                unit = 1000 if report.digits == 6 else 1
                dates = [report.nanoseconds(one) // unit for one in block.time.tolist()]
                time = pa.array(dates, kinds[0])
            schema = pa.schema(list(zip(titles, kinds, strict=True)))
            if writer is None:  # as the first rows say what times are
                writer = open_files.enter_context(parquet.ParquetWriter(partial, schema))
            numbers = np.column_stack([block.numbers, block.alarms])
            columns = [pa.array(column, from_pandas=True) for column in numbers.T]
            status = pa.array([STATUSES[code] for code in block.status], pa.string())
            writer.write_table(pa.Table.from_arrays([time, *columns, status], schema=schema))
        writer.add_key_value_metadata({KEY: json.dumps(about()).encode()})
