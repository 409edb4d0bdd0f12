"""Files of rows in blocks: text, also gzipped, and Parquet, never more than a block in memory.

Blocks of text are read by pyarrow. What it does not take, `reobserve.estimation.text_rows` reads
line by line, or refuses.
"""

from __future__ import annotations

import io
import math
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from decimal import Decimal
from itertools import compress
from os.path import exists, isfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, shown
from reobserve.core.extras import package
from reobserve.core.files import reason
from reobserve.estimation import date_columns
from reobserve.estimation.clock import Clock
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dates import ISO
from reobserve.estimation.dialect import Dialect, Head, bare, read_head
from reobserve.estimation.file_format import NOTHING
from reobserve.estimation.refusals import RowError
from reobserve.estimation.row_choice import RowChoice
from reobserve.estimation.streaming import LONGEST
from reobserve.estimation.text_rows import TextRows

Array = NDArray[np.float64]
Tell = Callable[[float], None]

BLOCK = 4 * 2**20  # characters of text, and about as many bytes of numbers
_HEAD = 2**16  # characters
_BUFFER = 2**20  # bytes of a column of a Parquet file
_PACKED = {".gz": "gzip", ".bz2": "bz2", ".lz4": "lz4", ".zst": "zstd"}
_TABLES = (".xlsx", ".xls", ".ods", ".mat", ".h5", ".hdf5", ".zip")


@dataclass(frozen=True)
class File:
    """A file of columns: Parquet by its ending, text with any other one."""

    path: Path
    dialect: Dialect = field(default_factory=Dialect)
    block: int = BLOCK

    def __post_init__(self) -> None:
        self.check_ending()
        if not isfile(self.path):  # False, too, of a name that no file can have
            problem = "is no regular file" if exists(self.path) else "there is no such file"
            raise InputError(str(self.path), problem)

    def check_ending(self) -> None:
        """Refuse tables of other programs, which are no text."""
        if self._ending in _TABLES:
            problem = f"must be text, such as .csv, or .parquet; a {self._ending} can be exported"
            raise InputError(str(self.path), problem)

    @property
    def _ending(self) -> str:
        return self.path.suffix.lower()

    @property
    def columnar(self) -> bool:
        """True if it is no text."""
        return self._ending == ".parquet"

    @property
    def word(self) -> str:
        """The name of a place in the file in messages."""
        return "row" if self.columnar else "line"

    def header(self) -> list[str]:
        """The titles of the columns.

        Raises
        ------
        InputError
            If the file cannot be read or has none.
        """
        with self.located():
            if self.columnar:
                import pyarrow.parquet as parquet

                return [str(name) for name in parquet.ParquetFile(self.packed()).schema_arrow.names]
            return self.head().titles

    def head(self) -> Head:
        """The lines above the rows of a text."""
        lines = (line for _, text in self.texts(0, _HEAD) for line in lines_of(text))
        return read_head(lines, self.dialect, str(self.path))

    def blocks(
        self,
        columns: Sequence[str],
        clock: Clock | None = None,
        report: DataReport | None = None,
        tell: Tell | None = None,
    ) -> Iterator[Array]:
        """The cells of these columns, nan where they are empty, some rows at a time.

        The first column of the clock has times by it: dates are turned into seconds, and what the
        report says that times count from is taken off. ``tell`` is called with the share of the
        file that was read, of its bytes or, in a Parquet file, its rows.

        Raises
        ------
        InputError
            If the file is damaged, a cell is no number, or a timestamp is no date where it must be.
        """
        report = report or DataReport()
        with self.located():
            if not self.columnar:
                yield from self._of_text(columns, clock, report, tell)
                return
            titles = () if clock is None else clock.titles
            choice = RowChoice(self.dialect.file.where, self.header(), str(self.path), report)
            for batch, rows in self._chosen([*columns, *titles], choice, tell):
                read = [
                    self._times(batch, clock, rows, report)
                    if clock is not None and name == titles[0]
                    else self._floats(batch.column(name), name)
                    for name in columns
                ]
                yield np.column_stack(read)
            choice.check_some()

    def first_rows(self, count: int) -> dict[str, list[Any]]:
        """The first cells of all columns of a Parquet file, by title."""
        with self.located():
            titles = self.header()
            first = next(self._batches(titles, None), None)
            return {title: [] for title in titles} if first is None else first[:count].to_pydict()

    def _chosen(
        self, columns: Sequence[str], choice: RowChoice, tell: Tell | None = None
    ) -> Iterator[tuple[Any, Sequence[int]]]:
        """Blocks of the rows to read of a Parquet file, and which rows of it these are, from 1."""
        above, titles = 0, [self.header()[place] for place in choice.places]
        for batch in self._batches(list(dict.fromkeys([*columns, *titles])), tell):
            rows = range(above + 1, above + 1 + batch.num_rows)
            above += batch.num_rows
            if not titles:
                yield batch, rows
                continue
            cells = zip(*(batch.column(title).to_pylist() for title in titles), strict=True)
            taken = np.array([not choice.leaves_out(row) for row in cells])
            if taken.any():
                yield batch.filter(taken), [*compress(rows, taken)]

    def _batches(self, columns: list[str], tell: Tell | None) -> Iterator[Any]:
        import pyarrow.parquet as parquet

        file = parquet.ParquetFile(  # without buffers, whole groups of rows would be in memory
            self.packed(), page_checksum_verification=True, pre_buffer=False, buffer_size=_BUFFER
        )  # fmt: skip
        read = 0
        rows = max(1, self.block // (8 * len(columns)))
        for batch in file.iter_batches(batch_size=rows, columns=columns, use_threads=False):
            read += batch.num_rows
            if tell is not None:
                tell(read / file.metadata.num_rows)
            yield batch

    def _of_text(
        self, columns: Sequence[str], clock: Clock | None, report: DataReport, tell: Tell | None
    ) -> Iterator[Array]:
        head = self.head()
        for why, count in head.left_out.items():
            report.count(report.left_out, why, count)
        rows, count = self.rows(head, columns, clock, report), 0
        for above, text in self.texts(head.lines, self.block, tell):
            rows.line, counted, latest = above, dict(report.left_out), report.latest
            try:
                values = self._at_once(rows, text)
            except ValueError:  # of pyarrow, too
                rows.line, report.left_out, report.latest = above, counted, latest
                read = [row for line in lines_of(text) for row in rows.read(line)]
                values = np.array([numbers for numbers, _ in read])
                lost = [count + k for k, (_, complete) in enumerate(read, 1) if not complete]
                report.refusals.leave_out(lost)
            count += len(values)
            if len(values):
                yield values
        rows.finish()
        rows.choice.check_some()

    def rows(
        self, head: Head, columns: Sequence[str], clock: Clock | None, report: DataReport
    ) -> TextRows:
        """The reader of the rows of a text."""
        return TextRows(self.dialect, head, columns, clock, str(self.path), report)

    def _at_once(self, rows: TextRows, text: str) -> Array:
        """The numbers of a block of text."""
        import pyarrow as pa
        import pyarrow.csv as reader_of_csv

        dialect, width = self.dialect, rows.width
        text, first = rows.plain(text)
        names = list(map(str, range(len(first))))
        if len(names) < min(width, rows.fewest):
            raise ValueError
        kinds = {name: pa.null() for name in names[width:]}  # where rows end with delimiters
        wanted = [names[place] for place in rows.places]
        clocks = [names[place] for place in rows.clocks]
        if clocks and not rows.exact:
            rows.time([first[place] for place in rows.clocks])  # which says what times count from
            if rows.report.shift is None:
                raise ValueError
        kinds |= dict.fromkeys(wanted, pa.float64())
        if rows.exact:
            kinds |= dict.fromkeys(clocks, pa.string())
        content = text.encode("utf-8", "surrogateescape")
        table = reader_of_csv.read_csv(
            pa.BufferReader(content),
            read_options=reader_of_csv.ReadOptions(
                use_threads=False, block_size=len(content) + 1, column_names=names
            ),
            parse_options=reader_of_csv.ParseOptions(
                delimiter="\t" if dialect.delimiter == "whitespace" else dialect.delimiter
            ),
            convert_options=reader_of_csv.ConvertOptions(
                include_columns=list(kinds), column_types=kinds,
                null_values=list(dialect.nothing), strings_can_be_null=True,
                decimal_point=dialect.decimal,
            ),
        )  # fmt: skip
        read = [self._floats(table.column(name), name) for name in wanted[rows.exact :]]
        if rows.exact:
            assert rows.clock is not None
            times, texts = None, [table.column(name) for name in clocks]
            if rows.clock.dates is not None:
                times = date_columns.read(texts, rows.clock.dates, rows.report)
            if times is None:
                cells = zip(*(column.to_pylist() for column in texts), strict=True)
                times = np.array([rows.time([cell or "" for cell in row]) for row in cells])
            read.insert(0, times)
        if dialect.timed and np.isnan(read[0]).any():
            raise ValueError
        rows.begun = True
        return np.column_stack(read)

    def texts(self, above: int, block: int, tell: Tell | None = None) -> Iterator[tuple[int, str]]:
        """Whole lines but the first ones ``above``, some at a time, and how many precede them."""
        number, rest = 0, ""
        with self.opened() as stream:
            codec, errors = self.dialect.codec(stream.read(2))
        with (
            self.packed() as packed,
            io.TextIOWrapper(self.opened(packed), codec, errors, newline="") as text_stream,
        ):
            while chunk := text_stream.read(block):
                if tell is not None:
                    tell(packed.tell() / packed.size())
                text = rest + chunk
                end = text.rfind("\n") + 1
                text, rest = text[:end], text[end:]
                if len(rest) > LONGEST:
                    if rest.strip("\0"):
                        problem = f"has a line of more than {LONGEST} characters"
                        raise InputError(str(self.path), problem)
                    rest = "\0"  # of a file made too long
                begun, number = number, number + text.count("\n")
                if number > above:
                    drop = max(0, above - begun)
                    yield begun + drop, text.split("\n", drop)[-1]
            if rest and number >= above:
                yield number, rest

    def opened(self, packed: Any = None) -> Any:
        """The bytes in it, unpacked, also of the open file that pyarrow has."""
        import pyarrow as pa

        return pa.input_stream(packed or self.packed(), _PACKED.get(self._ending))

    def packed(self) -> Any:
        """The bytes in it, as they are."""
        import pyarrow as pa

        return pa.OSFile(str(self.path))

    def lines_at(self, numbers: Sequence[int]) -> dict[int, int]:
        """The lines of rows in the file, or their rows in a Parquet file, all from 1 on."""
        lines, count, wanted = dict[int, int](), 0, set(numbers)
        if not wanted:
            return lines
        if self.columnar:
            if not self.dialect.file.where:
                return {k: k for k in wanted}
            choice = RowChoice(self.dialect.file.where, self.header(), str(self.path), DataReport())
            places = (place for _, taken in self._chosen([], choice) for place in taken)
            return {k: place for k, place in enumerate(places, 1) if k in wanted}
        head = self.head()
        rows = self.rows(head, (), None, DataReport())
        for _, text in self.texts(head.lines, self.block):
            for line in lines_of(text):
                count += (is_row := rows.row(line) is not None)
                if is_row and count in wanted:
                    lines[count] = rows.line
                    if len(lines) == len(wanted):
                        return lines
        return lines

    @contextmanager
    def lines(self) -> Iterator[None]:
        """Give errors of rows the lines of the file."""
        try:
            yield
        except RowError as error:
            raise error.at_line(self.lines_at([error.row]).get(error.row), self.word) from None

    def _times(self, batch: Any, clock: Clock, rows: Sequence[int], report: DataReport) -> Array:
        """Times of a block of a Parquet file, which has these of its rows."""
        import pyarrow as pa

        columns = [batch.column(title) for title in clock.titles]
        kind, dates = columns[0].type, clock.dates
        if dates is None:
            return self._seconds(columns[0], clock, report)
        if not columns[1:] and (pa.types.is_timestamp(kind) or pa.types.is_date(kind)):
            return date_columns.of_timestamps(columns[0], dates, report)
        for k, title in enumerate(clock.titles):
            kind = columns[k].type
            if pa.types.is_time(kind) or pa.types.is_date(kind):
                columns[k] = columns[k].cast(pa.string())
            elif not (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
                wanted = "texts, dates or times of day" if columns[1:] else "dates"
                problem = f"column {shown(title)} is of the type {kind}, must be {wanted}"
                raise InputError(str(self.path), problem)
        times = date_columns.read(columns, dates, report)
        if times is not None:
            return times
        where = f"of column {' and '.join(map(shown, clock.titles))}"
        seconds = []
        for row, *cells in zip(rows, *(column.to_pylist() for column in columns), strict=True):
            texts = [bare(cell or "") for cell in cells]
            time = math.nan
            if not any(text in NOTHING for text in texts):
                try:
                    place = str(self.path)
                    time = dates.seconds(" ".join(texts), f"row {row} {where}", place, report)
                except InputError as error:
                    report.refusals.refuse((where,), error, line=row)
                    report.refusals.leave_out([row])
            seconds.append(time)
        return np.array(seconds)

    def _seconds(self, column: Any, clock: Clock, report: DataReport) -> Array:
        """Times of a block of a Parquet file that are numbers or durations."""
        import pyarrow as pa

        if pa.types.is_duration(column.type) != clock.elapsed:
            problem = f"column {shown(clock.titles[0])} is of the type {column.type}"
            raise InputError(str(self.path), f"{problem}; durations have the unit duration")
        if clock.elapsed:
            ticks = column.cast(pa.duration("ns")).cast(pa.int64()).to_pylist()
            column = pa.array([None if k is None else Decimal(k).scaleb(-9) for k in ticks])
        numbers = self._floats(column, clock.titles[0])
        known = np.isfinite(numbers)
        if known.any():
            clock.begin(float(numbers[known.argmax()]), report)
        if not (report.shift or clock.elapsed):
            return numbers
        cells = column.to_pylist()
        return np.array([
            math.nan if cell is None else clock.exact(cell, report) for cell in cells
        ])  # fmt: skip

    def _floats(self, column: Any, name: str) -> Array:
        import pyarrow as pa

        kind = column.type
        if pa.types.is_timestamp(kind):
            problem = f"column {shown(name)} holds dates; as timestamps their unit is {ISO}"
            raise InputError(str(self.path), problem)
        if not (
            pa.types.is_floating(kind) or pa.types.is_integer(kind) or pa.types.is_decimal(kind)
            or pa.types.is_null(kind) or pa.types.is_boolean(kind)
        ):  # fmt: skip
            problem = f"column {shown(name)} is of the type {kind}, must be numbers"
            raise InputError(str(self.path), problem)
        return np.asarray(date_columns.numbers(column.cast(pa.float64(), safe=False)))

    @contextmanager
    def located(self) -> Iterator[None]:
        """Turn errors of reading into those of input."""
        package("pyarrow", "read a record")
        import pyarrow as pa

        try:
            yield
        except InputError:
            raise
        except (
            OSError, ValueError, KeyError, MemoryError, EOFError, zlib.error, pa.ArrowException
        ) as error:  # fmt: skip
            said = reason(error).splitlines() or [type(error).__name__]
            raise InputError(str(self.path), f"cannot be read ({said[0]})") from None


def lines_of(text: str) -> Iterator[str]:
    """Lines with their ends, which are line feeds and nothing else."""
    return iter(io.StringIO(text, newline="\n"))
