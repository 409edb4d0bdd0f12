"""Lines of text as rows of numbers.

Files and streams are read by the same functions, so that they give the same numbers and messages.
Lines count from 1 at the top of a file, as in an editor.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Sequence
from functools import partial

from reobserve.core.errors import InputError, shown
from reobserve.estimation.clock import Clock
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dates import ISO, looks_dated, seconds_of
from reobserve.estimation.dialect import COMMENTS, UNDECODED, Dialect, Head, bare
from reobserve.estimation.refusals import Kind
from reobserve.estimation.row_choice import RowChoice

_DATED = re.compile(r"\d{1,4}[./-]\d\d?[./-]\d{2,4} \d")
_HOUR = re.compile(r"\d\d?:\d\d")
_DECIMAL = re.compile(r"[+-]?\d*([.,])(\d+)([eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:([.,'’ \u00a0\u202f])\d{3})(?:\1\d{3})*(?:([.,])\d*)?")
_REPEATED, _TAIL = "repeated headers", "last line"


class TextRows:
    """Reads the lines below a header, one after the other. ``line`` counts them.

    Parameters
    ----------
    dialect, head
        Of the text.
    columns
        The titles of those to read.
    clock
        Of timestamps, whose first column is then the first of these; None if there are none.
    place
        What the text is called in messages.
    report
        Has the origin of times, and counts lines that are left out.
    """

    def __init__(
        self,
        dialect: Dialect,
        head: Head,
        columns: Sequence[str],
        clock: Clock | None,
        place: str,
        report: DataReport,
    ) -> None:
        self.dialect, self.head, self.titles = dialect, head, list(columns)
        self.clock, self.place, self.report = clock, place, report
        self.width = len(head.titles)
        self.places = [head.titles.index(title) for title in columns]
        self.clocks = [] if clock is None else [head.titles.index(title) for title in clock.titles]
        self.choice = RowChoice(dialect.file.where, head.titles, place, report)
        read = [*self.places, *self.clocks, *self.choice.places]
        self.least = max(read, default=0) + 1  # cells of a row
        self.line = head.lines
        self.ended, self.repeats, self.complete = True, False, True
        self.begun = bool(dialect.file.names)
        self.held: tuple[Kind, InputError, int] | None = None  # of the last row, with its line

    def row(self, line: str) -> str | None:
        """The line if it is a row, or None."""
        file = self.dialect.file
        self.line += 1
        self.ended = line.endswith("\n")
        self.repeats = bool(self.head.text) and line.strip() == self.head.text
        if self.dialect.is_empty(line):
            return None
        reason = ""
        if not self.ended and file.tail == "drop":
            reason = _TAIL
        elif self.dialect.is_comment(line):
            reason = COMMENTS
        elif self.repeats and file.repeated_header == "skip":
            reason = _REPEATED
        if reason:
            self.report.count(self.report.left_out, reason, 1)
            return None
        if self.held is not None:
            (kind, error, at), self.held = self.held, None
            self.report.refusals.refuse(kind, error, line=at)
        if file.where:
            cells = self._split(line)
            if self.choice.leaves_out([cells[k] for k in self.choice.places if k < len(cells)]):
                return None
        return line

    def _refuse(self, kind: Kind, make: Callable[[], InputError]) -> None:
        """Refuse a row, or wait if it may be the last one, which is left out then."""
        if self.dialect.file.tail == "drop":
            self.held = kind, make(), self.line
        else:
            self.report.refusals.refuse(kind, make, line=self.line)

    def finish(self) -> None:
        """Count the last row if it was left out."""
        if self.held is not None:
            self.report.count(self.report.left_out, _TAIL, 1)
            self.held = None

    def cells(self, row: str) -> list[str] | None:
        """The cells of a row, or None if it is left out.

        The first one shows whether the header is right. From then on, cells that nobody reads may
        lack at the end of a row, and there may be some without a title that are no numbers.
        """
        cells, width = self._split(row), self.width
        if len(cells) == width or (len(cells) > width and not any(map(str.strip, cells[width:]))):
            self.begun = True
            return cells
        if len(cells) >= self.fewest and not any(map(self._is_number, cells[width:])):
            return cells
        whose = "file.names" if self.dialect.file.names else "the header"
        count = "1 cell" if len(cells) == 1 else f"{len(cells)} cells"
        problem = f"line {self.line} has {count}, {whose} has {width}"
        numbered = any(map(self._is_number, cells))
        if not self.ended:
            hint = "; it has no line end: with file.tail: drop it is left out"
        elif not numbered:
            hint = "; if it is no row, file.comment may state how such lines begin"
        elif self.is_first:
            hint = (
                f"; if the header is wrong, file.skip: {self.line - 1} leaves it out and "
                "file.names states the columns"
            )
        else:
            hint = "; if it is the last one and truncated, file.tail: drop leaves it out"
        kind = (self.place, count, str(self.ended), str(numbered))
        self._refuse(kind, lambda: InputError(self.place, problem + hint))
        return None

    @property
    def fewest(self) -> float:
        """The least number of cells of a row, infinite if it must be as many as the header's."""
        if not (self.begun or self.report.rows):
            return math.inf
        return self.least if self.ended else self.width

    def _split(self, row: str) -> list[str]:
        try:
            return self.dialect.cells(row)
        except csv.Error:
            return []

    def numbers(self, cells: list[str]) -> list[float] | None:
        """The numbers in the columns to read, nan where there are none, or None as in `cells`."""
        values, dated = [], self.clock is not None
        for column, place in enumerate(self.places):
            try:
                if dated and column == 0:
                    values.append(self.time([cells[place] for place in self.clocks]))
                else:
                    values.append(self.dialect.number(cells[place]))
            except ValueError as error:
                row = (dated and column > 0) or any(map(self._is_number, cells))
                whole = self.repeats or not (self.ended and row)
                text = bare(cells[place])
                kind: Kind = (self.titles[column], "" if text.lstrip("+-")[:1].isdigit() else text)
                if self.repeats or not self.ended:
                    kind = ("repeated" if self.repeats else "truncated",)
                self._refuse(kind, partial(self._refusal, column, cells, error))
                if whole or self.held is not None:
                    return None
                values.append(math.nan)
                self.complete = False
        return values

    def read(self, line: str) -> list[tuple[list[float], bool]]:
        """The rows that a line settles, and whether they are complete (refuses as `numbers`).

        A row that is refused is one of nan, so that rows count as in `row`.
        """
        held, self.complete, lost = self.held, True, [math.nan] * len(self.places)
        row = self.row(line)
        rows = [(lost, False)] if held is not None and self.held is None else []
        if row is not None:
            cells = self.cells(row)
            numbers = None if cells is None else self.numbers(cells)
            if self.held is None:
                rows.append((numbers or lost, numbers is not None and self.complete))
        return rows

    def plain(self, text: str) -> tuple[str, list[str]]:
        """A text of rows alone with cells between single delimiters, and the cells of the first."""
        dialect, file = self.dialect, self.dialect.file
        blank = dialect.delimiter == "whitespace"
        if (
            self.held
            or dialect.thousands
            or text.count("\r") > text.count("\r\n")
            or (blank and '"' in text)
        ):
            raise ValueError
        some = file.comment or file.where or file.repeated_header == "skip"
        if blank or some or not text.endswith("\n"):
            rows = filter(None, map(self.row, io.StringIO(text, newline="\n")))
            text = "".join("\t".join(dialect.cells(row)) + "\n" if blank else row for row in rows)
        first = next(filter(str.strip, io.StringIO(text, newline="\n")), "")
        if not first:
            raise ValueError
        return text, dialect.cells(first) if not blank else first.split("\t")

    def time(self, cells: Sequence[str]) -> float:
        """The time [s] in cells of the clock, nan where one means nothing."""
        clock, dialect, report = self.clock, self.dialect, self.report
        assert clock is not None
        if clock.dates is not None:
            texts = list(map(bare, cells))
            if any(text in dialect.nothing for text in texts):
                return math.nan
            return clock.dates.seconds(" ".join(texts), self._where(0), self.place, report)
        text = dialect.spelled(cells[0])
        if text is None:
            return math.nan
        text = seconds_of(text) if clock.elapsed else text
        number = float(text)
        clock.begin(number, report)
        return clock.exact(text, report) if report.shift and math.isfinite(number) else number

    @property
    def exact(self) -> bool:
        """True if times are read from texts: dates, durations, or numbers with very many digits."""
        clock = self.clock
        return clock is not None and bool(clock.dates or clock.elapsed or self.report.shift)

    def _where(self, column: int) -> str:
        titles = self.titles[column : column + 1]
        if column == 0 and self.clock is not None:
            titles = list(self.clock.titles)
        return f"line {self.line} of column {' and '.join(map(shown, titles))}"

    def _is_number(self, cell: str) -> bool:
        try:
            return not math.isnan(self.dialect.number(cell))
        except ValueError:
            return False

    def _refusal(self, column: int, cells: list[str], error: ValueError) -> InputError:
        """The error of a cell that is no number."""
        cell = cells[self.places[column]]
        elapsed = column == 0 and self.clock is not None and self.clock.elapsed
        wanted = "a duration, as 26:30:00 or 1d 02:30:00" if elapsed else "a number"
        problem = f"{self._where(column)} is {shown(cell)}, must be {wanted}"
        if isinstance(error, InputError):
            problem = error.problem
        if not self.ended:
            hint = "; the line has no end: with file.tail: drop it is left out"
        elif self.repeats:
            hint = "; the line repeats the header: with file.repeated_header: skip it is left out"
        elif UNDECODED.search(cell):
            hint = f"; it is not {self.dialect.encoding.upper()}, see columns.encoding"
        else:
            hint = "" if isinstance(error, InputError) else _hint(cell, self.dialect.decimal)
            digit = cell.strip(' "')[:1].isdigit()
            if not (hint or digit or any(map(self._is_number, cells))) and self.is_first:
                hint = "; if the line states units, file.below_header: [units] reads it"
                if self.dialect.file.names:
                    hint = f"; if the line is a header, file.skip: {self.line} leaves it out"
            elif not (hint or (digit and isinstance(error, InputError))):
                hint = "; if it means a missing value, state it in file.missing_values"
        return InputError(self.place, problem + hint)

    @property
    def is_first(self) -> bool:
        """True in the first line below the header."""
        return self.line == self.head.lines + 1


def _hint(cell: str, decimal: str) -> str:
    """The key that would read a cell as a number."""
    text = bare(cell)
    if looks_dated(text):
        return f"; of dates the unit is {ISO}"
    if _DATED.match(text):
        return '; of dates state columns.time.format, as "%d.%m.%Y %H:%M:%S"'
    if _HOUR.match(text):
        hint = '; of times of day state columns.time.format, as "%H:%M:%S", and columns.time.day'
        return f"{hint}; of durations columns.time.unit is duration"
    keys = []
    if (match := _DECIMAL.fullmatch(text)) and match[1] != decimal:
        keys.append(f'columns.decimal: "{match[1]}"')
    if match := _THOUSANDS.fullmatch(text):
        key, other = f'columns.thousands: "{match[1]}"', match[2] or decimal
        keys.append(key + (f' and columns.decimal: "{other}"' if other != decimal else ""))
    return f"; state {' or '.join(keys)}" if keys else ""
