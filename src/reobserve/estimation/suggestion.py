"""A guess at the layout of a text, for a user to look at and to paste into a specification.

Of the delimiters, that one is taken by which most lines have the same number of cells, and most
cells are numbers, dates or times. The first such line is the first row; the header is the nearest
line above it with as many titles. No guess is ever used to read a record.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from dataclasses import dataclass, field
from datetime import datetime
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import yaml

from reobserve.core.errors import InputError
from reobserve.core.units import readings
from reobserve.estimation.dates import ISO, looks_dated
from reobserve.estimation.dialect import Dialect
from reobserve.estimation.file_format import NOTHING
from reobserve.estimation.reading import File

_LOOKED_AT = 2**18  # bytes
SIGNS = ("#", "%", "//", "!", "*", '"#')
_DELIMITERS = (";", "\t", "|", ",", "whitespace")
_NUMBERS = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"),
    ",": re.compile(r"[+-]?(\d+(,\d+)?|,\d+)([eE][+-]?\d+)?"),
}
_GROUPED = {
    (",", "."): re.compile(r"[+-]?\d{1,3}(\.\d{3})+,\d+"),
    (".", ","): re.compile(r"[+-]?\d{1,3}(,\d{3})+\.\d+"),
}
_DAY = re.compile(r"\d{1,4}([-./])\d\d?\1\d{1,4}")
_HOUR = re.compile(r"\d\d?:\d\d(:\d\d([.,]\d+)?)?( ?[AaPp][Mm])?")
_DATE = re.compile(rf"{_DAY.pattern}[T ]{_HOUR.pattern}(Z| ?[+-]\d\d:?\d\d)?")
_EPOCHS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))


@dataclass(frozen=True)
class Suggestion:
    """Keys of `columns` and `file` that read a text, and what is in doubt about them."""

    columns: dict[str, Any] = field(default_factory=dict)
    file: dict[str, Any] = field(default_factory=dict)
    titles: list[str] = field(default_factory=list)
    first: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def text(self, place: str) -> str:
        """YAML to paste, below comments on what is there."""
        pairs = zip(self.titles, [*self.first, *[""] * len(self.titles)], strict=False)
        listed = [f"#   {title or '(no title)'}: {cell or '(empty)'}" for title, cell in pairs]
        lines = [f"# columns of {place}, and their first cells:", *listed]
        lines += [f"# {note}" for note in self.notes]
        for key, keys in (("columns", self.columns), ("file", self.file)):
            if keys:
                lines.append(dumped({key: keys}))
        if not (self.columns or self.file):
            lines.append("# no keys are needed to read it")
        return "\n".join(lines)


def dumped(tree: dict[str, Any]) -> str:
    """A mapping as YAML, each section in a line."""
    return "\n".join(
        f"{key}: " + yaml.safe_dump(
            keys, default_flow_style=True, sort_keys=False, allow_unicode=True, width=10_000
        ).strip()
        for key, keys in tree.items()
    )  # fmt: skip


def suggest(path: Path) -> Suggestion:
    """The layout of a text, as far as its first rows show it.

    Raises
    ------
    InputError
        If it cannot be read, or no lines look like rows.
    """
    file = File(path)
    if file.columnar:
        return Suggestion(titles=file.header())
    with file.opened() as stream:
        raw = stream.read(_LOOKED_AT)
        whole = not stream.read(1)
    encoding, text = _decoded(raw)
    lines = text.split("\n")
    ended = whole and not lines[-1]
    lines = [line.rstrip("\r") for line in (lines[:-1] if ended or not whole else lines)]
    found = [_Grid(lines, delimiter) for delimiter in _DELIMITERS]
    best = max(found, key=lambda grid: grid.score)
    if not best.score:
        raise InputError(str(path), "has no lines that look like rows of numbers")
    return best.suggestion(encoding, ended or not whole)


def _decoded(raw: bytes) -> tuple[str, str]:
    if raw[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return "utf-8", raw.decode("utf-16", "replace")  # which its mark states
    if raw[1:200:2].count(0) > 50:
        return "utf-16", raw.decode("utf-16-le", "replace")
    try:
        return "utf-8", codecs.getincrementaldecoder("utf-8-sig")().decode(raw)
    except UnicodeDecodeError:
        return "cp1252", raw.decode("cp1252", "replace")


class _Grid:
    """Lines in cells between delimiters."""

    def __init__(self, lines: list[str], delimiter: str) -> None:
        self.dialect, self.lines = Dialect(delimiter), lines
        self.rows = {k: self._cells(line) for k, line in enumerate(lines) if line.strip()}
        late = list(self.rows.values())[len(self.rows) // 4 :]
        self.width = max(Counter(map(len, late)).items(), key=lambda one: one[::-1], default=(0,))[
            0
        ]
        every = [cell for row in late if len(row) == self.width for cell in row]
        self.decimal, self.thousands = self._marks(every)
        start = (k for k, row in self.rows.items() if len(row) == self.width and self._is_row(row))
        self.start = next(start, -1)
        self.score = 0.0
        if self.start >= 0:
            below = [row for k, row in self.rows.items() if k >= self.start]
            cells = [cell for row in below for cell in row]
            fit = sum(len(row) == self.width for row in below) / len(below)
            read = sum(map(self._is_value, cells)) / max(len(cells), 1)
            self.score = fit * read**2 * (1.0 if self.width > 1 else 0.5)

    def _cells(self, line: str) -> list[str]:
        try:
            return [cell.strip().strip('"').strip() for cell in self.dialect.cells(line)]
        except csv.Error:
            return []

    def _marks(self, cells: list[str]) -> tuple[str, str]:
        """The decimal mark, and that of thousands."""
        for (decimal, thousands), form in _GROUPED.items():
            if any(map(form.fullmatch, cells)):
                return decimal, thousands
        commas = sum("," in one and bool(_NUMBERS[","].fullmatch(one)) for one in cells)
        points = sum("." in one and bool(_NUMBERS["."].fullmatch(one)) for one in cells)
        return ("," if commas > points else "."), ""

    def _is_number(self, cell: str) -> bool:
        text = cell.replace(self.thousands, "") if self.thousands else cell
        return _NUMBERS[self.decimal].fullmatch(text) is not None

    def _is_value(self, cell: str) -> bool:
        forms = (_DAY, _HOUR, _DATE)
        return cell in NOTHING or self._is_number(cell) or any(f.fullmatch(cell) for f in forms)

    def _is_row(self, cells: list[str]) -> bool:
        some = [cell for cell in cells if cell not in NOTHING]
        values = sum(map(self._is_value, some))
        return values > 0 and values >= 0.5 * len(some)

    def suggestion(self, encoding: str, ended: bool) -> Suggestion:
        """The keys of a specification."""
        columns: dict[str, Any] = {"decimal": self.decimal, "thousands": self.thousands}
        if self.width > 1:
            columns = {"delimiter": self.dialect.delimiter, **columns}
        columns["encoding"] = encoding
        usual = vars(Dialect())
        columns = {key: value for key, value in columns.items() if value != usual[key]}
        file, titles = self._head()
        notes: list[str] = []
        self._odd_lines(file, titles, ended, notes)
        if missing := self._missing():
            file["missing_values"] = missing
        if time := self._time(titles, notes):
            columns = {"time": time, **columns}
        return Suggestion(columns, file, titles, self.rows[self.start], notes)

    def _sign(self, lines: list[str]) -> str:
        """The sign with which all lines begin, or nothing."""
        return next((s for s in SIGNS if lines and all(one.startswith(s) for one in lines)), "")

    def _fits(self, titles: list[str]) -> bool:
        """True if there are as many titles as cells that are not empty throughout."""
        while titles and not titles[-1]:
            titles = titles[:-1]
        below = [row for k, row in self.rows.items() if k >= self.start and len(row) == self.width]
        beyond = any(cell for row in below for cell in row[len(titles) :])
        numbers = sum(map(self._is_number, titles))
        return 0 < len(titles) <= self.width and not beyond and numbers <= 0.2 * len(titles)

    def _head(self) -> tuple[dict[str, Any], list[str]]:
        """The keys that read what is above the rows, and the titles."""
        above = {k: line for k, line in enumerate(self.lines[: self.start]) if line.strip()}
        if above and re.fullmatch(r"sep=[,;\t|]", next(iter(above.values()))):
            del above[next(iter(above))]
        file: dict[str, Any] = {}
        for k in reversed(above):
            if self._fits(self.rows[k]) and not above[k].startswith(SIGNS):
                before = [line for j, line in above.items() if j < k]
                below = [j for j in above if j > k]
                if below:
                    file["below_header"] = [self._kind(self.rows[j]) for j in below]
                if sign := self._sign(before):
                    file["comment"] = sign
                elif before:
                    file["skip"] = k
                return file, self.rows[k]
        if (sign := self._sign(list(above.values())[-1:])) and above:
            last = next(reversed(above))
            titles = self._cells(above[last][len(sign) :].strip())
            if self._fits(titles):
                if plain := [j for j, line in above.items() if not line.startswith(sign)]:
                    file["skip"] = plain[-1] + 1
                return {**file, "comment": sign, "header": "commented"}, titles
        if sign := self._sign(list(above.values())):
            file["comment"] = sign
        elif above:
            file["skip"] = self.start
        names = [str(k + 1) for k in range(self.width)]
        return {**file, "names": names}, names

    def _kind(self, cells: list[str]) -> str:
        """The kind of a line below the header."""
        bare = [re.sub(r"^[\[(](.*)[\])]$", r"\1", cell) for cell in cells if cell]
        known = sum(unit in ("-", "1", "%") or bool(readings(unit)) for unit in bare)
        return "units" if bare and known >= 0.5 * len(bare) else "skip"

    def _odd_lines(
        self, file: dict[str, Any], titles: list[str], ended: bool, notes: list[str]
    ) -> None:
        """Lines among the rows that are none."""
        last = max(self.rows)
        if not ended:
            notes.append("the last line has no line end; file.tail: drop would leave it out")
        for k, cells in self.rows.items():
            if k < self.start or (self._is_row(cells) and len(cells) == self.width):
                continue
            line = self.lines[k]
            if sign := self._sign([line]):
                file.setdefault("comment", sign)
            elif cells == titles:
                file["repeated_header"] = "skip"
            elif k == last:
                file["tail"] = "drop"
            elif len(cells) != self.width:
                notes.append(f"line {k + 1} has {len(cells)} cells, others have {self.width}")

    def _missing(self) -> list[str]:
        """Texts that stand where other rows have values."""
        rows = [r for k, r in self.rows.items() if k >= self.start and len(r) == self.width]
        found: dict[str, None] = {}
        for column in zip(*rows, strict=True):
            odd = [cell for cell in column if not self._is_value(cell)]
            if 0 < len(odd) < 0.5 * len(column) and len(set(odd)) <= 5:
                found.update(dict.fromkeys(odd))
        return list(found)[:20]

    def _time(self, titles: list[str], notes: list[str]) -> dict[str, Any]:
        """The key `time`, if a column looks like timestamps."""
        rows = [r for k, r in self.rows.items() if k >= self.start and len(r) == self.width]
        columns = [[cell for cell in column if cell] for column in zip(*rows, strict=True)]
        for k, (title, cells) in enumerate(zip(titles, columns, strict=False)):
            if cells and all(map(_DATE.fullmatch, cells)):
                return self._dated(title, cells, notes)
            following = columns[k + 1] if k + 1 < min(len(columns), len(titles)) else []
            if cells and all(map(_DAY.fullmatch, cells)):
                if following and all(map(_HOUR.fullmatch, following)):
                    both = [f"{a} {b}" for a, b in zip(cells, following, strict=False)]
                    return {**self._dated("", both, notes), "column": [title, titles[k + 1]]}
                return self._dated(title, cells, notes)
        for title, cells in zip(titles, columns, strict=False):
            if len(cells) > 1 and all(map(self._is_number, cells)):
                numbers = [float(one.replace(self.thousands or "\0", "").replace(",", "."))
                           for one in cells]  # fmt: skip
                if all(a < b for a, b in pairwise(numbers)):
                    unit = next((unit for most, unit in _EPOCHS if numbers[0] > most), "")
                    notes.append(f"time may be another column; {title!r} is the first that rises")
                    return {"column": title, **({"unit": unit} if unit else {})}
        return {}

    def _dated(self, title: str, cells: list[str], notes: list[str]) -> dict[str, Any]:
        if all(map(_is_iso, cells)):
            return {"column": title, "unit": ISO}
        forms = [form for form in _forms(cells[0]) if all(_reads(form, one) for one in cells)]
        if not forms:
            notes.append(f"dates such as {cells[0]} need a columns.time.format")
            return {"column": title, "format": ""}
        if len(forms) > 1:
            notes.append(f"dates such as {cells[0]} may also be of {' or '.join(forms[1:])}")
        return {"column": title, "format": forms[0]}


def _is_iso(cell: str) -> bool:
    try:
        datetime.fromisoformat(cell)
    except ValueError:
        return False
    return looks_dated(cell)


def _forms(cell: str) -> list[str]:
    """Formats that a date may have."""
    day = _DAY.match(cell)
    if day is None:
        return []
    mark, rest = day[1], cell[day.end() :]
    orders = ("d m Y", "m d Y", "Y m d", "d m y", "m d y")
    days = ["%" + f"{mark}%".join(order.split()) for order in orders]
    hours = [""]
    if rest:
        hours = [
            f"{rest[0]}{hour}{zone}"
            for hour, zone in product(
                ("%H:%M", "%H:%M:%S", "%H:%M:%S.%f", "%H:%M:%S,%f", "%I:%M %p", "%I:%M:%S %p"),
                ("", "%z", " %z"),
            )
        ]
    return [one + hour for one, hour in product(days, hours)]


def _reads(form: str, cell: str) -> bool:
    try:
        datetime.strptime(cell, form)
    except ValueError:
        return False
    return True
