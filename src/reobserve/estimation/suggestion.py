"""A specification for a record that nobody has seen yet, without the model, and its doubts.

Rows are the lines with the number of cells that most numbers, dates and times stand in; that
delimiter is taken by which they fill the lines best. The header is the nearest line above the first
row with as many titles, or with units below it. No guess is ever used to read a record.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from reobserve.core.documents import dumped
from reobserve.core.errors import InputError
from reobserve.core.units import readings
from reobserve.core.validation import parse
from reobserve.estimation.dialect import SIGNS, Dialect, bare, read_head
from reobserve.estimation.file_format import NOTHING, FileFormat
from reobserve.estimation.layout import split_title
from reobserve.estimation.record_file import File
from reobserve.estimation.suggested_sampling import sampling
from reobserve.estimation.suggested_time import DATE, DAY, HOUR, Number, Unsure, find_time

_LOOKED_AT = 2**18  # bytes
_ROWS = 1000  # of a Parquet file
_DELIMITERS = (";", "\t", "|", ",", "whitespace")
_NUMBERS = {
    ".": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"),
    ",": re.compile(r"[+-]?(\d+(,\d+)?|,\d+)([eE][+-]?\d+)?"),
}
_GROUPED = {
    (",", "."): re.compile(r"[+-]?\d{1,3}(\.\d{3})+,\d+"),
    (".", ","): re.compile(r"[+-]?\d{1,3}(,\d{3})+\.\d+"),
}
_MOST_TEXTS = 5  # of a column, that stand for missing values


_UNKNOWN = "?"  # in the place of what only the user knows, which each key refuses
# A model for one measurement, as long as there is no other.
_EXAMPLE: dict[str, Any] = {
    "kind": "kalman", "time": "discrete", "A": [[1.0]], "C": [[1.0]], "Q": 0.01, "R": 1.0,
    "initial_state": [0.0], "initial_covariance": 1.0e6,
}  # fmt: skip


@dataclass(frozen=True)
class Suggestion:
    """Sections of a specification that read a record, and sentences on keys that are in doubt."""

    columns: dict[str, Any] = field(default_factory=dict)
    file: dict[str, Any] = field(default_factory=dict)
    titles: list[str] = field(default_factory=list)
    first: list[str] = field(default_factory=list)
    measured: list[dict[str, str]] = field(default_factory=list)
    sampling: dict[str, Any] = field(default_factory=dict)
    unsure: dict[str, str] = field(default_factory=dict)

    def text(self, place: str) -> str:
        """The specification, below comments on what is there and what is in doubt."""
        pairs = zip(self.titles, [*self.first, *[""] * len(self.titles)], strict=False)
        listed = [f"#   {title or '(no title)'}: {cell or '(empty)'}" for title, cell in pairs]
        lines = [f"# columns of {place}, and their first cells:", *listed]
        lines += [f"# unsure: {key}: {said}" for key, said in self.unsure.items()]
        lines += ["# fill in the observer; this one takes one measurement for a random walk:"]
        lines += ["# " + dumped({"observer": _EXAMPLE}), f"observer: '{_UNKNOWN}'", "columns:"]
        lines += [f"  {dumped({'': {key: part}})[3:-1]}" for key, part in self.columns.items()]
        lines += ["  measurements:  # others may be taken in, also as inputs"]
        entries = [dumped({"": entry})[2:] for entry in self.measured]
        lines += [f"    {'# ' * (k > 0)}- {entry}" for k, entry in enumerate(entries)]
        sections = {"sampling": self.sampling, "file": self.file}
        return "\n".join([*lines, dumped({key: part for key, part in sections.items() if part})])


def suggest(path: Path) -> Suggestion:
    """The specification for a record, as far as its first rows and all its timestamps show it."""
    file, unsure = File(path), Unsure()
    found = _of_parquet(file, unsure) if file.columnar else _of_text(file, unsure)
    time, columns = found.columns.pop("time", {}), found.columns
    measured = [entry for entry in found.measured if entry["column"] not in _names(time)]
    if not measured:
        unsure.of("columns.measurements", "no column has numbers, but those of times")
        measured = [{"column": _UNKNOWN}]
    read = {**columns, "time": time, "measurements": measured[:1]}
    policies = sampling(path, {"observer": _EXAMPLE, "columns": read, "file": found.file}, unsure)
    if wrap := policies.pop("wrap", None):
        time["wrap"] = wrap
    if "sampling.period" in unsure.asked:
        policies["period"] = _UNKNOWN
    for key in unsure.asked - {"sampling.period"}:
        time[key.removeprefix("columns.time.")] = _UNKNOWN
    columns = {**({"time": time} if time else {}), **columns}
    return Suggestion(
        columns, found.file, found.titles, found.first, measured, policies, unsure.sentences
    )


def _names(time: dict[str, Any]) -> list[str]:
    """The names of columns of times."""
    column = time.get("column", [])
    return [column] if isinstance(column, str) else column


def _of_text(file: File, unsure: Unsure) -> Suggestion:
    with file.located(), file.opened() as stream:
        raw = stream.read(_LOOKED_AT)
        whole = not stream.read(1)
    encoding, text = _decoded(raw)
    lines = text.split("\n")
    ended = whole and not lines[-1]
    lines = [line.rstrip("\r") for line in (lines[:-1] if ended or not whole else lines)]
    grids = [_Grid(lines, delimiter) for delimiter in _DELIMITERS]
    best = max(grids, key=lambda grid: grid.score)
    if not best.score:
        raise InputError(str(file.path), "has no lines that look like rows of numbers")
    return best.suggestion(encoding, ended or not whole, unsure)


def _of_parquet(file: File, unsure: Unsure) -> Suggestion:
    """The columns of a Parquet file, with the times among them."""
    rows = file.first_rows(_ROWS)
    texts = [["" if cell is None else str(cell) for cell in column] for column in rows.values()]
    time = find_time(list(rows), texts, _float, unsure)
    first = [column[0] if column else "" for column in texts]
    measured = _measured(list(rows), [""] * len(rows), texts, _float, unsure)
    return Suggestion({"time": time} if time else {}, {}, list(rows), first, measured)


def _measured(
    names: list[str], units: list[str], columns: Sequence[Sequence[str]], number: Number,
    unsure: Unsure,
) -> list[dict[str, str]]:  # fmt: skip
    """Columns of numbers with their units, those that have most of them, and vary, first."""
    found = list[tuple[tuple[Any, ...], dict[str, str]]]()
    for k, (name, cells) in enumerate(zip(names, columns, strict=False)):
        some = list(filter(None, cells))
        numbers = [value for value in map(number, some) if value is not None]
        if len(numbers) <= 0.5 * len(some):
            texts = Counter(some)
            dated = any(form.fullmatch(text) for text in texts for form in (DAY, HOUR, DATE))
            if not (numbers or dated) and 1 < len(texts) <= min(_MOST_TEXTS, len(some) // 4):
                listed = " or ".join(map(repr, texts))
                problem = f"{name!r} is {listed}; if rows are of several quantities, it takes one"
                unsure.of("file.where", problem)
            continue
        said, entry = units[k] or split_title(name)[1], {"column": name}
        if "/" in name and readings(name):
            entry["unit"] = name
            unsure.of(f"the unit of {name!r}", "the title may be a unit, or end in one")
        elif said:
            entry["unit"] = said if readings(said) else "1"
        if entry.get("unit", said) != said:
            unsure.of(f"the unit of {name!r}", f"{said!r} is no unit that is known")
        steps = [b - a for a, b in pairwise(numbers)] or [0.0]
        even = max(steps) - min(steps) <= 1e-3 * abs(steps[0])  # as of counters and constants
        odd = (len(some) - len(numbers), len(cells) - len(some), even, k)
        found.append((odd, entry))
    return [entry for _, entry in sorted(found, key=lambda pair: pair[0])]


def _float(cell: str) -> float | None:
    with suppress(ValueError):
        return float(cell)
    return None


def _decoded(raw: bytes) -> tuple[str, str]:
    if raw[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return "utf-8", raw.decode("utf-16", "replace")  # which its mark states
    if raw[1:200:2].count(0) > 0.4 * len(raw[1:200:2]):
        return "utf-16", raw.decode("utf-16-le", "replace")
    try:
        return "utf-8", codecs.getincrementaldecoder("utf-8-sig")().decode(raw)
    except UnicodeDecodeError:
        return "cp1252", raw.decode("cp1252", "replace")


def sign_of(line: str) -> str:
    """The sign of comments with which a line begins, or nothing."""
    if line.startswith('"#"'):
        return ""
    return next((sign for sign in (*SIGNS, '"#') if line.startswith(sign)), "")


def kind_of_line(cells: list[str]) -> str:
    """The kind of a line below the header: `units`, or one to `skip`."""
    bare = [re.sub(r"^[\[(](.*)[\])]$", r"\1", cell) for cell in cells if cell]
    known = sum(unit in ("-", "1", "%") or bool(readings(unit)) for unit in bare)
    return "units" if bare and known >= 0.5 * len(bare) else "skip"


def _lacks(titles: list[str]) -> int:
    """The number of titles that are empty, or occur before."""
    return titles.count("") + len(titles) - len(set(titles))


def _are_units(upper: list[str], lower: list[str]) -> bool:
    """True if the upper one of two lines has units, and the lower one titles, as T and m may be."""
    signs = [any(re.search(r"[^\w\s\[\]().]", cell) for cell in line) for line in (upper, lower)]
    kinds = [kind_of_line(upper), kind_of_line(lower)]
    return kinds == ["units", "skip"] or (kinds[0] == "units" and signs == [True, False])


class _Grid:
    """Lines in cells between delimiters, of which most have ``width``."""

    def __init__(self, lines: list[str], delimiter: str) -> None:
        self.dialect, self.lines = Dialect(delimiter), lines
        self.rows = {k: self._cells(line) for k, line in enumerate(lines) if line.strip()}
        plain = {k: row for k, row in self.rows.items() if not sign_of(lines[k])}
        several = [cell for row in plain.values() if len(row) > 1 for cell in row]
        self.decimal, self.thousands = self._marks(
            several or [c for r in plain.values() for c in r]
        )
        weights = Counter[int]()
        for row in plain.values():
            if self._is_row(row):
                weights[len(row)] += sum(map(self._is_value, filter(None, row)))
        self.width = max(weights, key=lambda width: (weights[width], width), default=0)
        body = {k: r for k, r in plain.items() if len(r) == self.width and self._is_row(r)}
        self.typical, self.texts = self._columns(list(body.values()))
        self.start = next((k for k, row in body.items() if self._is_like(row)), -1)
        self.units, self.doubt = [""] * self.width, ""  # in a line above the titles
        self.score, self.head = 0.0, (dict[str, Any](), list[str]())
        if self.start >= 0:
            self._begin()
            below = [row for k, row in plain.items() if k >= self.start]
            cells = [cell for row in below for cell in row if cell]
            fit = sum(len(row) == self.width for row in below) / len(below)
            read = sum(map(self._is_value, cells)) / max(len(cells), 1)
            self.score = fit * read**2 * (1.0 if self.width > 1 else 0.5)
            self.score *= 1.0 if any(map(str.isdigit, self.head[1])) else 1.3
            self.score *= 0.9 if delimiter == "whitespace" else 1.0

    def _begin(self) -> None:
        """Find the header. The line that seemed to be the first row may be one."""
        self.head = self._head()
        numbers = [k for k in self.rows if k > self.start]
        row = self.rows[self.start]
        odd = [cell for k, cell in enumerate(row) if k in self.typical and self._is_odd(k, cell)]
        if "names" in self.head[0] and odd and numbers:
            self.start = numbers[0]
            self.head = self._head(odd)

    def _cells(self, line: str) -> list[str]:
        try:
            return list(map(bare, self.dialect.cells(line)))
        except csv.Error:
            return []

    def _marks(self, cells: list[str]) -> tuple[str, str]:
        """The decimal mark, and that of thousands."""
        for (decimal, thousands), form in _GROUPED.items():
            if any(map(form.fullmatch, cells)):
                return decimal, thousands
        commas = sum("," in cell and bool(_NUMBERS[","].fullmatch(cell)) for cell in cells)
        points = sum("." in cell and bool(_NUMBERS["."].fullmatch(cell)) for cell in cells)
        return ("," if commas > points else "."), ""

    def _is_number(self, cell: str) -> bool:
        text = cell.replace(self.thousands, "") if self.thousands else cell
        return _NUMBERS[self.decimal].fullmatch(text) is not None

    def _number(self, cell: str) -> float | None:
        if not self._is_number(cell):
            return None
        return float(cell.replace(self.thousands or "\0", "").replace(",", "."))

    def _is_value(self, cell: str) -> bool:
        forms = (DAY, HOUR, DATE)
        return cell in NOTHING or self._is_number(cell) or any(f.fullmatch(cell) for f in forms)

    def _is_row(self, cells: list[str]) -> bool:
        some = [cell for cell in cells if cell not in NOTHING]
        values = sum(map(self._is_value, some))
        return values > 0 and values >= 0.5 * len(some)

    def _columns(self, body: list[list[str]]) -> tuple[list[int], list[Counter[str]]]:
        """The columns with values in most rows, and the texts that stand there in their place."""
        columns = list(zip(*body, strict=True))
        values = [sum(self._is_value(cell) for cell in column if cell) for column in columns]
        typical = [k for k, count in enumerate(values) if count > 0.5 * len(body)]
        texts = [Counter(c for c in column if not self._is_value(c)) for column in columns]
        return typical, texts

    def _is_odd(self, column: int, cell: str) -> bool:
        """True if a cell has a text that no other one of its column has."""
        return not self._is_value(cell) and self.texts[column][cell] < 2

    def _is_like(self, row: list[str]) -> bool:
        """True if a row has values where most rows have them."""
        fit = sum(bool(row[k]) and not self._is_odd(k, row[k]) for k in self.typical)
        return fit >= 0.5 * len(self.typical)

    @property
    def _body(self) -> list[list[str]]:
        """The rows, without headers that are repeated, and without comments."""
        below = {k: row for k, row in self.rows.items() if k >= self.start}
        return [
            row for k, row in below.items()
            if len(row) == self.width and row != self.head[1] and not sign_of(self.lines[k])
        ]  # fmt: skip

    def suggestion(self, encoding: str, ended: bool, unsure: Unsure) -> Suggestion:
        """The keys of a specification."""
        columns: dict[str, Any] = {"decimal": self.decimal, "thousands": self.thousands}
        if self.width > 1:
            columns = {"delimiter": self.dialect.delimiter, **columns}
        columns["encoding"] = encoding
        usual = vars(Dialect())
        columns = {key: value for key, value in columns.items() if value != usual[key]}
        file, titles = self.head
        self._odd_lines(file, titles, ended, unsure)
        if self.doubt:
            unsure.of("file.below_header", self.doubt)
        if missing := self._missing():
            file["missing_values"] = missing
        body = list(zip(*self._body, strict=True))
        self._check_marks([cell for column in body for cell in column], unsure)
        names = [title if title and titles.count(title) == 1 else f"column {k + 1}"
                 for k, title in enumerate(titles)]  # fmt: skip
        pairs = zip(self._full(file, titles), names, titles, strict=True)
        full = [whole if name == title else name for whole, name, title in pairs]
        units = [unit or (split_title(whole)[1] if whole != name else "")
                 for unit, whole, name in zip(self.units, full, names, strict=False)]  # fmt: skip
        if time := find_time(full, body, self._number, unsure, self.units):
            timed = [names[full.index(name)] for name in _names(time)]
            columns = {"time": {**time, "column": timed if timed[1:] else timed[0]}, **columns}
            if any(name not in titles for name in timed):
                titles, above = names, {"skip": self.start} if self.start else {}
                dropped = ("header", "below_header", "skip")
                file = {k: v for k, v in file.items() if k not in dropped}
                file = {**file, **above, "names": [*names, *[""] * (self.width - len(names))]}
        measured = _measured(names, units, body, self._number, unsure)
        measured = [entry for entry in measured if entry["column"] in titles]
        return Suggestion(columns, file, titles, self.rows[self.start], measured)

    def _full(self, file: dict[str, Any], titles: list[str]) -> list[str]:
        """Titles with the units that are read from the lines below them."""
        if "units" in file.get("below_header", []):
            dialect = replace(self.dialect, file=parse(FileFormat, file))
            with suppress(InputError):
                full = read_head((f"{line}\n" for line in self.lines), dialect, "").titles
                return [*map(bare, full), *titles[len(full) :]][: len(titles)]
        return titles

    def _check_marks(self, cells: Sequence[str], unsure: Unsure) -> None:
        """Say so where all marks in numbers may be those of thousands."""
        marked = [cell for cell in cells if self.decimal in cell and self._is_number(cell)]
        form = re.compile(rf"[+-]?[1-9]\d{{0,2}}\{self.decimal}\d{{3}}")
        if marked and all(map(form.fullmatch, marked)) and not self.thousands:
            problem = f"{marked[0]} may have a mark of thousands, too"
            unsure.of("columns.decimal", problem)

    def _sign(self, lines: list[str]) -> str:
        """The sign with which all lines begin, or nothing."""
        signs = set(map(sign_of, lines))
        return signs.pop() if len(signs) == 1 else ""

    def _fits(self, titles: list[str], odd: list[str] | None = None) -> bool:
        """True if there are as many titles as cells that are not empty throughout.

        Few of them are numbers, but where ``odd`` ones show that it is a header.
        """
        while titles and not titles[-1]:
            titles = titles[:-1]
        beyond = any(cell for row in self._body for cell in row[len(titles) :])
        numbers = 0 if odd and set(odd) <= set(titles) else sum(map(self._is_number, titles))
        texts = any(title and not self._is_value(title) for title in titles)
        few = numbers <= 0.2 * len(titles)
        return texts and 0 < len(titles) <= self.width and not beyond and few

    def _head(self, odd: list[str] | None = None) -> tuple[dict[str, Any], list[str]]:
        """The keys that read what is above the rows, and the titles."""
        above = {k: line for k, line in enumerate(self.lines[: self.start]) if line.strip()}
        if above and re.fullmatch(r"sep=[,;\t|]", next(iter(above.values()))):
            del above[next(iter(above))]
        fitting = [k for k in reversed(above) if self._fits(self._bare(above[k]), odd)]
        full = [k for k in fitting if _lacks(self._bare(above[k])) < 2]
        fitting = full or fitting  # without a line of Smp, say, below titles and units
        nearest = self._bare(above[max(above)]) if above else []
        if sum(map(bool, nearest)) > self.width and not any(map(self._is_value, nearest)):
            fitting = []  # titles of more columns than rows have
        if len(fitting) > 1 and self._states_units(*(above[k] for k in fitting[1::-1])):
            fitting = fitting[1:]
        for k in fitting:
            below = [j for j in above if j > k]
            sign = self._sign([above[k]])
            if sign and not below:
                return self._commented(above, k, sign), self._bare(above[k])
            units = self._bare(above[below[-1]]) if below else []
            if sign and (len(units) != self.width or kind_of_line(units) != "units"):
                break
            file: dict[str, Any] = {}
            if below:
                file["below_header"] = [kind_of_line(self._bare(above[j])) for j in below]
                file["below_header"] = [
                    kind
                    if j == below[-1] or "units" not in file["below_header"][n + 1 :]
                    else "skip"
                    for n, (j, kind) in enumerate(zip(below, file["below_header"], strict=True))
                ]
            before = [line for j, line in above.items() if j < k]
            if before and not below:
                units = self._bare(before[-1])
                if len(units) == self.width and _are_units(units, self._bare(above[k])):
                    self.units = [unit if readings(unit) else "" for unit in units]
            if (mark := self._sign(before)) and not sign:
                file["comment"] = mark
            elif before:
                file["skip"] = k
            return file, [self.rows[k][0], *self.rows[k][1:]] if not sign else self._bare(above[k])
        return self._unnamed(above)

    def _states_units(self, upper: str, lower: str) -> bool:
        """True if the lower one of two lines that fit seems to have the units of the other."""
        titles, units = self._bare(upper), self._bare(lower)
        alike = bool(self._sign([upper])) == bool(self._sign([lower]))
        known = all(unit == "-" or readings(unit) for unit in filter(None, units))
        if kind_of_line(units) != "units" or _are_units(titles, units):
            return False
        if not alike and (self._sign([lower]) or not known):
            return False
        if not (alike and known):
            self.doubt = f"{lower!r} may have titles, or units of those above it"
        return True

    def _bare(self, line: str) -> list[str]:
        """The cells of a line without the sign of a comment."""
        return self._cells(line[len(self._sign([line])) :].strip())

    def _commented(self, above: dict[int, str], last: int, sign: str) -> dict[str, Any]:
        """The keys that read a header which is the last comment."""
        file: dict[str, Any] = {"comment": sign, "header": "commented"}
        plain = [j for j, line in above.items() if not line.startswith(sign) and j < last]
        return {"skip": plain[-1] + 1, **file} if plain else file

    def _unnamed(self, above: dict[int, str]) -> tuple[dict[str, Any], list[str]]:
        """The keys of a text without a header, with titles from the nearest line that has some."""
        file: dict[str, Any] = {}
        if sign := self._sign(list(above.values())):
            file["comment"] = sign
        elif above:
            file["skip"] = self.start
        names = [str(k + 1) for k in range(self.width)]
        for line in reversed(above.values()):
            cells = self._bare(line)
            texts = [cell for cell in cells if cell and not self._is_value(cell)]
            if len(texts) == len(set(texts)) and 0.5 * self.width < len(texts) <= len(cells) >= (
                self.width - 1
            ):  # fmt: skip
                padded = [*cells, *[""] * self.width][: self.width]
                names = [a or b for a, b in zip(padded, names, strict=True)]
                break
        return {**file, "names": names}, names

    def _odd_lines(
        self, file: dict[str, Any], titles: list[str], ended: bool, unsure: Unsure
    ) -> None:
        """Lines among the rows that are none."""
        last, odd = max(self.rows), list[int]()
        if not ended:
            unsure.of("file.tail", "the last line has no line end; drop leaves it out")
        for k, cells in self.rows.items():
            if k < self.start or (self._is_row(cells) and len(cells) == self.width):
                continue
            if sign := self._sign([self.lines[k]]):
                file.setdefault("comment", sign)
            elif cells == titles and "names" not in file:
                file["repeated_header"] = "skip"
            elif k == last:
                file["tail"] = "drop"
            elif len(cells) != self.width:
                odd.append(k)
        if odd:
            problem = f"{len(odd)} lines have another number of cells than rows, {self.width}"
            unsure.of("file.comment", f"{problem}; the first one is line {odd[0] + 1}")
        before = [k for k, row in self.rows.items() if k < self.start and self._is_row(row)]
        if len(before) > 10:
            problem = f"{len(before)} lines above line {self.start + 1} look like rows, too"
            unsure.of("file.skip", problem)

    def _missing(self) -> list[str]:
        """Texts that stand where other rows have values."""
        texts: dict[str, None] = {}
        for column in zip(*self._body, strict=True):
            known = [cell for cell in column if cell]
            odd = [cell for cell in known if not self._is_value(cell)]
            if 0 < len(odd) < 0.5 * len(known) and len(set(odd)) <= _MOST_TEXTS:
                texts.update(dict.fromkeys(odd))
        return list(texts)[:20]
