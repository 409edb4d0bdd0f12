"""The dialect of a text, as a specification states it, and what stands above its rows."""

from __future__ import annotations

import codecs
import csv
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import zip_longest

from reobserve.core.errors import InputError, shown
from reobserve.estimation.file_format import NOTHING, FileFormat
from reobserve.estimation.specification import Specification

LONGEST_HEADER = 2**16  # characters

_SEPARATOR = re.compile(r"sep=([,;\t|])[\r\n]*")
_BLANKS = re.compile(r"[ \t]+")
_TRUTHS = dict.fromkeys(("true", "True", "TRUE"), "1")
_TRUTHS |= dict.fromkeys(("false", "False", "FALSE"), "0")
UNDECODED = re.compile("[\udc80-\udcff]")

SIGNS = ("#", "%", "//", "!", "*", "~")  # with which comments often begin
COMMENTS = "comments"
_SKIPPED, _BELOW = "above the header", "below the header"


@dataclass(frozen=True)
class Dialect:
    """The way a text spells rows. The keys are those of `columns` and `file`.

    Where rows are ``timed``, a line of delimiters alone is no row, as it has no timestamp.
    """

    delimiter: str = ","
    decimal: str = "."
    thousands: str = ""
    encoding: str = "utf-8"
    file: FileFormat = field(default_factory=FileFormat)
    timed: bool = False

    @classmethod
    def of(cls, specification: Specification) -> Dialect:
        """The dialect of a specification."""
        columns = specification.columns
        return cls(
            columns.delimiter, columns.decimal, columns.thousands, columns.encoding,
            specification.file, bool(columns.time.columns),
        )  # fmt: skip

    def codec(self, begin: bytes) -> tuple[str, str]:
        """The codec of a text that begins so, and how it takes errors, which cells then refuse.

        The byte order mark of UTF-16 says so, as there is none like it in UTF-8. Without it, the
        low byte comes first, as on most machines.
        """
        marked = begin[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
        if marked and self.encoding in ("utf-8", "utf-16"):
            return "utf-16", "replace"
        if self.encoding == "utf-16":
            return "utf-16-le", "replace"
        name = "utf-8-sig" if self.encoding == "utf-8" else self.encoding
        return name, "surrogateescape"

    @cached_property
    def nothing(self) -> frozenset[str]:
        """Texts that mean a missing value."""
        return frozenset(NOTHING + self.file.missing_values)

    @property
    def plain(self) -> bool:
        """True if `float` reads each cell that has a number."""
        return not (
            self.decimal != "." or self.thousands or any(map(_number, self.file.missing_values))
        )

    def is_blank(self, line: str) -> bool:
        """True if a line has nothing in it."""
        return not line.strip(" \t\r\n" if self.delimiter == "whitespace" else " \r\n")

    def is_empty(self, line: str) -> bool:
        """True if a line below the header has nothing in its cells, and so is no row."""
        delimiter = "" if self.delimiter == "whitespace" else self.delimiter
        alone = self.timed and not line.strip(f'{delimiter} "\r\n')
        return alone or self.is_blank(line)

    def is_comment(self, line: str) -> bool:
        """True if a line begins with the sign of comments."""
        return bool(self.file.comment) and line.lstrip(" ").startswith(self.file.comment)

    def cells(self, line: str) -> list[str]:
        """The cells of a line.

        Raises
        ------
        csv.Error
            If there is a carriage return within the line.
        """
        line = line.rstrip("\r\n")
        if '"' not in line:
            if self.delimiter == "whitespace":
                return _BLANKS.split(line.strip(" \t"))
            return line.split(self.delimiter)
        delimiter = self.delimiter
        if delimiter == "whitespace":
            line = re.sub(r'("[^"]*")|[ \t]+', lambda match: match[1] or "\t", line.strip(" \t"))
            delimiter = "\t"
        return next(csv.reader([line], delimiter=delimiter), [])

    def number(self, cell: str) -> float:
        """The number in a cell, or nan for a missing one.

        Raises
        ------
        ValueError
            If there is something else.
        """
        text = self.spelled(cell)
        return math.nan if text is None else float(text)

    def spelled(self, cell: str) -> str | None:
        """The number in a cell as Python spells it, or None for a missing one.

        Raises
        ------
        ValueError
            If its marks are not those of the dialect.
        """
        text = bare(cell)
        if text in self.nothing:
            return None
        if self.thousands and self.thousands in text:
            text = self._joined(text)
        text = _TRUTHS.get(text, text)
        if text.startswith(("+ ", "- ")):
            text = text[0] + text[1:].lstrip()
        if self.decimal == ",":
            if "." in text:
                raise ValueError
            text = text.replace(",", ".")
        if "_" in text:
            raise ValueError
        return text

    def _joined(self, text: str) -> str:
        """A number without marks of thousands, which stand between groups of three digits."""
        whole, mark, rest = text.partition(self.decimal)
        if self.thousands == self.decimal:  # the last mark is the decimal one
            whole, mark, rest = text.rpartition(self.decimal)
        first, *groups = whole.lstrip("+-").split(self.thousands)
        three = all(len(group) == 3 and group.isdigit() for group in groups)
        if groups and not (three and first.isdigit() and len(first) <= 3):
            raise ValueError
        return whole.replace(self.thousands, "") + mark + rest


def bare(cell: str) -> str:
    """The text in a cell, without quotes and the blanks inside and outside of them."""
    return cell.strip().strip('"').strip()


def _number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


@dataclass(frozen=True)
class Head:
    """The titles of columns, and the ``lines`` above the first row.

    ``text`` is the header. ``first`` is the first row, if it was read to find the header.
    """

    titles: list[str]
    lines: int = 1
    text: str = ""
    first: str | None = None
    left_out: dict[str, int] = field(default_factory=dict)


def read_head(lines: Iterator[str], dialect: Dialect, place: str) -> Head:
    """Read the lines above the rows of a text, which messages call ``place``."""
    file, titles = dialect.file, list(dialect.file.names)
    wanted = [] if titles else ["header", *file.below_header]
    read, comments, comment, header, first = 0, 0, "", "", None
    while wanted or read < max(file.skip, 1):
        line = next(lines, None)
        if line is None and read < file.skip:
            problem = f"{file.skip} must be less: {place} has {read} lines"
            raise InputError("file.skip", problem)
        read += line is not None
        text = line or ""
        if read == 1 and states_delimiter(text, dialect.delimiter) and not file.skip:
            continue
        if line is not None and read <= file.skip:
            continue
        if not wanted:
            first = line
            break
        if dialect.is_comment(text):
            comment, comments = text, comments + 1
        elif line is None or not dialect.is_blank(text):
            kind = wanted.pop(0)
            if kind == "header" and file.header == "commented":
                if not comments:
                    problem = f"commented must be left out: no comment is above the rows of {place}"
                    raise InputError("file.header", problem)
                header, comments = comment.lstrip(" ")[len(file.comment) :], comments - 1
                titles = _titles(header, dialect, place)
                if not wanted:
                    first = line
                    break
                kind = wanted.pop(0)
            if kind == "header":
                header, titles = text, _titles(text, dialect, place)
            elif kind == "units":
                titles = _with_units(titles, dialect.cells(text))
    left_out = {_SKIPPED: file.skip, _BELOW: file.below_header.count("skip"), COMMENTS: comments}
    return Head(
        titles, read - (first is not None), header.strip(), first,
        {why: count for why, count in left_out.items() if count},
    )  # fmt: skip


def states_delimiter(line: str, delimiter: str) -> bool:
    """True if a file's first line is ``sep=;``, as spreadsheets write it."""
    match = _SEPARATOR.fullmatch(line)
    if match is not None and match[1] != delimiter:
        raise InputError(
            "columns.delimiter",
            f"{shown(delimiter)} must be {shown(match[1])}, as the record's first line says",
        )
    return match is not None


def _titles(header: str, dialect: Dialect, place: str) -> list[str]:
    if len(header) > LONGEST_HEADER:
        problem = f"its header has more than {LONGEST_HEADER} bytes, or no line ends"
        raise InputError(place, problem)
    if match := UNDECODED.search(header) or re.search("\0", header):
        wide = match[0] == "\0"
        byte = len(header[: match.start()].encode(dialect.encoding)) + 1
        raise InputError(
            place,
            f"its header cannot be read (byte {byte} is not {dialect.encoding.upper()}); "
            f"columns.encoding may state {'utf-16' if wide else 'cp1252 or latin-1'}",
        )
    try:
        titles = [title.strip() for title in dialect.cells(header)]
    except csv.Error:  # a carriage return
        titles = ["\r"]
    if any("\r" in title for title in titles):
        problem = "its header cannot be read: lines must end with line feeds, not with \\r alone"
        raise InputError(place, problem)
    while titles and not titles[-1]:
        del titles[-1]
    if not titles:
        raise InputError(place, "its header is empty, must name the columns")
    return titles


def _with_units(titles: list[str], units: list[str]) -> list[str]:
    """Titles as they would be with units in them."""
    pairs = zip_longest(titles, map(unbracketed, units[: len(titles)]))
    return [f"{title} [{unit}]" if title and unit else title for title, unit in pairs]


def unbracketed(unit: str) -> str:
    """A unit without the brackets around it."""
    return re.sub(r"^[\[(](.*)[\])]$", r"\1", unit.strip()).strip()
