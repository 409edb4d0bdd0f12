"""Files of rows in blocks: CSV and Parquet, CSV also gzipped, never more than a block in memory."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package
from reobserve.core.files import reason
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dates import ISO, SECOND, timestamp
from reobserve.estimation.layout import NOTHING, no_number

Array = NDArray[np.float64]

BLOCK = 4 * 2**20  # bytes of text, and about as many of numbers
_NO_NUMBER = re.compile(r"Row #(\d+): CSV conversion error to double: invalid value '(.*)'$")
_DELIMITER = re.compile(rb"(?:\xef\xbb\xbf)?sep=([,;\t])\r?\n?")
_LONGEST_HEADER = 2**16  # bytes
_ENDINGS = (".csv", ".csv.gz", ".parquet")


@dataclass(frozen=True)
class File:
    """A file of columns. The keys are those of `reobserve.estimation.specification.Columns`."""

    path: Path
    delimiter: str = ","
    decimal: str = "."
    encoding: str = "utf-8"
    format: str = ""
    block: int = BLOCK

    def __post_init__(self) -> None:
        if not str(self.path).endswith(_ENDINGS):
            raise InputError(str(self.path), f"must end with {', '.join(_ENDINGS)}")
        if not self.path.is_file():
            problem = "is no regular file" if self.path.exists() else "there is no such file"
            raise InputError(str(self.path), problem)

    @property
    def _columnar(self) -> bool:
        return self.path.suffix == ".parquet"

    def header(self) -> list[str]:
        """The titles of the columns.

        Raises
        ------
        InputError
            If the file cannot be read or has none.
        """
        with self._located():
            if self._columnar:
                import pyarrow.parquet as parquet

                return [str(name) for name in parquet.ParquetFile(self.path).schema_arrow.names]
            lines = self._first_lines()
            line = lines[1 if states_delimiter(lines[0], self.delimiter) else 0]
            return titles(line, self.delimiter, str(self.path), self.encoding)

    def _first_lines(self) -> list[bytes]:
        """The first two lines of text."""
        first = bytearray()
        with self._text() as stream:
            while first.count(b"\n") < 2 and len(first) < _LONGEST_HEADER:
                chunk = stream.read(4096)
                if not chunk:
                    break
                first += chunk
        lines = bytes(first).split(b"\n")
        header = 1 if _DELIMITER.fullmatch(lines[0]) else 0
        if len(lines) == header + 1 and len(first) >= _LONGEST_HEADER:
            problem = f"its header has more than {_LONGEST_HEADER} bytes, or no line ends"
            raise InputError(str(self.path), problem)
        return [*lines, b""][:2]

    def blocks(
        self, columns: Sequence[str], dated: str = "", report: DataReport | None = None
    ) -> Iterator[Array]:
        """The cells of these columns, nan where they are empty, some rows at a time.

        Those of the column ``dated`` are dates, which become times by the clock of the report.

        Raises
        ------
        InputError
            If the file is damaged, a cell is no number, or one of ``dated`` is no date.
        """
        rows, report = 0, report or DataReport()
        with self._located():
            for batch in self._batches(list(columns), dated):
                read = [
                    self._times(batch, name, rows, report)
                    if name == dated
                    else self._floats(batch, name)
                    for name in columns
                ]
                yield np.column_stack(read)
                rows += batch.num_rows

    def _batches(self, columns: list[str], dated: str) -> Iterator[Any]:
        import pyarrow as pa

        if self._columnar:
            import pyarrow.parquet as parquet

            file = parquet.ParquetFile(self.path, page_checksum_verification=True)
            rows = max(1, self.block // (8 * len(columns)))
            yield from file.iter_batches(batch_size=rows, columns=columns, use_threads=False)
            return
        import pyarrow.csv as reader_of_csv

        kinds = {name: pa.string() if name == dated else pa.float64() for name in columns}
        with self._text() as stream:
            reader = reader_of_csv.open_csv(
                stream,
                read_options=reader_of_csv.ReadOptions(
                    use_threads=False, block_size=self.block, column_names=self.header(),
                    skip_rows=1 + states_delimiter(self._first_lines()[0], self.delimiter),
                    encoding=self.encoding.replace("utf-8", "utf8"),
                ),
                parse_options=reader_of_csv.ParseOptions(delimiter=self.delimiter),
                convert_options=reader_of_csv.ConvertOptions(
                    include_columns=columns, column_types=kinds,
                    null_values=list(NOTHING), decimal_point=self.decimal,
                ),
            )  # fmt: skip
            yield from reader

    def _text(self) -> Any:
        import pyarrow as pa

        return pa.input_stream(str(self.path), compression="detect")

    def _times(self, batch: Any, name: str, rows: int, report: DataReport) -> Array:
        import pyarrow as pa
        import pyarrow.compute as compute

        column = batch.column(name)
        if pa.types.is_timestamp(column.type):
            ticks = compute.fill_null(column.cast(pa.timestamp("ns")).cast(pa.int64()), 0)
            timestamps = ticks.to_numpy(zero_copy_only=False)
            known = column.is_valid().to_numpy(zero_copy_only=False)
            if not known.any():
                return np.full(len(known), np.nan)
            report.clock(int(timestamps[known.argmax()]))
            assert report.origin is not None
            return np.where(known, (timestamps - report.origin * SECOND) / SECOND, np.nan)
        if not (pa.types.is_string(column.type) or pa.types.is_large_string(column.type)):
            problem = f"column {shown(name)} is of the type {column.type}, must be dates"
            raise InputError(str(self.path), problem)
        cells = enumerate((text or "" for text in column.to_pylist()), rows + 1)
        return np.array(
            [report.clock(timestamp(cell, NOTHING, name, row, self.format)) for row, cell in cells]
        )

    def _floats(self, batch: Any, name: str) -> Array:
        import pyarrow as pa

        column = batch.column(name)
        kind = column.type
        if pa.types.is_timestamp(kind):
            problem = f"column {shown(name)} holds dates; as timestamps their unit is {ISO}"
            raise InputError(str(self.path), problem)
        if not (
            pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind)
            or pa.types.is_null(kind)
        ):  # fmt: skip
            problem = f"column {shown(name)} is of the type {kind}, must be numbers"
            raise InputError(str(self.path), problem)
        return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False))

    @contextmanager
    def _located(self) -> Iterator[None]:
        package("pyarrow", "read a record")
        import pyarrow as pa

        try:
            yield
        except InputError:
            raise
        except (OSError, ValueError, KeyError, MemoryError, EOFError, pa.ArrowException) as error:
            said = reason(error).splitlines() or [type(error).__name__]
            if found := _NO_NUMBER.search(said[0]):
                above = 1 + states_delimiter(self._first_lines()[0], self.delimiter)
                row, cell = int(found[1]) - above, found[2]
                raise InputError(str(self.path), no_number(row, cell, cell, self.decimal)) from None
            raise InputError(str(self.path), f"cannot be read ({said[0]})") from None


def states_delimiter(line: bytes, delimiter: str) -> bool:
    """True if a file's first line is ``sep=;``, as spreadsheets write it.

    Raises
    ------
    InputError
        If it is another delimiter than the one of the specification.
    """
    found = _DELIMITER.fullmatch(line)
    if found is None:
        return False
    said = found[1].decode()
    if said != delimiter:
        raise InputError(
            "columns.delimiter",
            f"{shown(delimiter)} must be {shown(said)}, as the record's first line says",
        )
    return True


def titles(line: bytes, delimiter: str, place: str, encoding: str = "utf-8") -> list[str]:
    """The titles in the header of a text, which is called ``place`` in messages.

    Raises
    ------
    InputError
        If it is not in this encoding or has none.
    """
    try:
        text = line.decode("utf-8-sig" if encoding == "utf-8" else encoding).strip("\r\n")
    except UnicodeDecodeError as error:
        raise InputError(
            place,
            f"its header cannot be read (byte {error.start + 1} is not {encoding.upper()}); "
            "columns.encoding may state cp1252 or latin-1",
        ) from None
    try:
        found = [title.strip() for row in csv.reader([text], delimiter=delimiter) for title in row]
    except csv.Error:  # a carriage return, or a title of more than 131 072 characters
        problem = "its header cannot be read: lines must end with line feeds, not with \\r alone"
        raise InputError(place, problem) from None
    if not any(found):
        raise InputError(place, "its header is empty, must name the columns")
    return found
