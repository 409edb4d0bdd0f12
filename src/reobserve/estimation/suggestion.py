"""A specification for a record that nobody has seen yet, without the model, and its doubts.

Rows are the lines with the number of cells that most numbers, dates and times stand in; that
delimiter is taken by which they fill the lines best. The header is the nearest line above the first
row with as many titles, or with units below it. No guess is ever used to read a record.
"""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache, partial
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

from reobserve.core.documents import dumped
from reobserve.core.errors import InputError
from reobserve.core.units import readings
from reobserve.estimation.dialect import SIGNS, UNDECODED, Dialect, bare, unbracketed
from reobserve.estimation.file_format import NOTHING
from reobserve.estimation.layout import split_title
from reobserve.estimation.record_file import File
from reobserve.estimation.suggested_sampling import sampling
from reobserve.estimation.suggested_time import DATE, DAY, HOUR, Number, Unsure, find_time

_LOOKED_AT = 2**17  # characters, twice
_ROWS = 1000  # of a Parquet file
_DELIMITERS = (";", "\t", "|", ",", "whitespace")
_MARKS = ((".", ""), (",", ""), (".", ","), (",", "."))  # of decimals, and of thousands
_FEW_CELLS = 2000  # in which marks are looked for
_FEW_LINES = 10  # which may belong to a preamble
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
    found = _of_parquet(file, unsure) if file.columnar else _of_text(path, unsure)
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


def _of_text(path: Path, unsure: Unsure) -> Suggestion:
    for encoding in ("utf-8", "cp1252", "utf-16"):
        file = File(path, Dialect(encoding=encoding))
        with file.located():
            text = "".join(part for _, part in islice(file.texts(0, _LOOKED_AT), 2))
        wrong = encoding == "utf-8" and UNDECODED.search(text)
        if not wrong and text.count("\0") <= 0.2 * len(text):
            break
    lines = [line.rstrip("\r") for line in text.removesuffix("\n").split("\n")]
    marks = [mark for mark in _DELIMITERS if mark in text or mark == "whitespace"]
    grids = [_Grid(lines, Dialect(mark, encoding=encoding)) for mark in marks]
    best = max(grids, key=lambda grid: grid.score)
    if not best.score:
        raise InputError(str(path), "has no lines that look like rows of numbers")
    return best.suggestion(text.endswith("\n"), unsure)


def _of_parquet(file: File, unsure: Unsure) -> Suggestion:
    """The columns of a Parquet file, with the times among them."""
    rows = file.first_rows(_ROWS)
    texts = [["" if cell is None else str(cell) for cell in column] for column in rows.values()]
    units, number = [split_title(title)[1] for title in rows], partial(_number, Dialect())
    time = find_time(list(rows), units, texts, number, unsure)
    first = [column[0] if column else "" for column in texts]
    measured = _measured(list(rows), units, texts, number, unsure)
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
                unsure.sentences.setdefault("file.where", problem)
            continue
        said, entry = units[k], {"column": name}
        if "/" in name and readings(name):
            entry["unit"] = name
            unsure.of(f"the unit of {name!r}", "the title may be a unit, or end in one")
        elif said:
            entry["unit"] = said if readings(said) else "1"
        if entry.get("unit", said) != said:
            unsure.of(f"the unit of {name!r}", f"{said!r} is no unit that is known")
        steps = [b - a for a, b in pairwise(numbers)] or [0.0]
        even = max(steps) - min(steps) <= 1e-3 * abs(steps[0])  # as of counters and constants
        odd = (len(some) - len(numbers), even, len(cells) - len(some), k)
        found.append((odd, entry))
    return [entry for _, entry in sorted(found, key=lambda pair: pair[0])]


def _number(dialect: Dialect, cell: str) -> float | None:
    """The number in a cell, None if it has none."""
    with suppress(ValueError):
        number = dialect.number(cell)
        return number if math.isfinite(number) else None
    return None


def sign_of(line: str) -> str:
    """The sign of comments with which a line begins, or nothing."""
    if line.startswith('"#"'):
        return ""
    return next((sign for sign in (*SIGNS, '"#') if line.startswith(sign)), "")


def kind_of_line(cells: list[str]) -> str:
    """The kind of a line below the header: `units`, or one to `skip`."""
    units = [unbracketed(cell) for cell in cells if cell]
    known = sum(unit in ("-", "1", "%") or bool(readings(unit)) for unit in units)
    return "units" if units and known >= 0.5 * len(units) else "skip"


def _skipping(lines: list[str], count: int) -> dict[str, Any]:
    """The key that leaves out lines at the beginning: a sign of comments, or their number."""
    signs = set(map(sign_of, lines))
    sign = signs.pop() if len(signs) == 1 else ""
    return {"comment": sign} if sign else {"skip": count} if lines else {}


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

    def __init__(self, lines: list[str], dialect: Dialect) -> None:
        self.dialect, self.lines = dialect, lines
        self.rows = {k: self._cells(line) for k, line in enumerate(lines) if line.strip()}
        plain = {k: row for k, row in self.rows.items() if not sign_of(lines[k])}
        several = [row for row in plain.values() if len(row) > 1] or plain.values()
        cells = [cell for row in several for cell in row if "." in cell or "," in cell]
        self.dialect = max(
            (replace(dialect, decimal=decimal, thousands=mark) for decimal, mark in _MARKS),
            key=lambda one: sum(_number(one, cell) is not None for cell in cells[:_FEW_CELLS]),
        )
        self._number = cache(partial(_number, self.dialect))
        self._is_value = cache(self._has_value)
        weights = Counter[int]()
        for row in plain.values():
            if self._is_row(row):
                weights[len(row)] += sum(map(self._is_value, filter(None, row)))
        self.width = max(weights, key=lambda width: (weights[width], width), default=0)
        self._fill_up(plain)
        body = {k: r for k, r in plain.items() if len(r) == self.width and self._is_row(r)}
        self.typical, self.texts = self._columns(list(body.values()))
        like = [k for k, row in body.items() if self._is_like(row)]
        self.first = next(iter(like), -1)  # that looks like a row
        self.start = self._first(plain, like)
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
            self.score *= 0.9 if dialect.delimiter == "whitespace" else 1.0

    def _fill_up(self, plain: dict[int, list[str]]) -> None:
        """Take rows as long as the first one, if this has as many cells as the titles above it."""
        lines = ((above, row) for above, row in pairwise(plain.values()) if self._is_row(row))
        above, first = next(lines, ([], []))
        if self.width < len(first) == len(above) and not any(map(self._is_value, above)):
            short = [cells for cells in plain.values() if len(cells) == self.width]
            self.width = len(first)
            for cells in short:
                cells.extend([""] * (self.width - len(cells)))

    def _first(self, plain: dict[int, list[str]], like: list[int]) -> int:
        """The first of the lines that are ``like`` rows, below texts that few of them precede."""
        start, said = self.first, Counter(self.lines)
        for k, row in plain.items():
            texts = len(row) == self.width > 1 and not any(map(self._is_value, filter(None, row)))
            if texts and start < k <= start + _FEW_LINES and said[self.lines[k]] == 1:
                start = next((j for j in like if j > k), start)
        return start

    def _begin(self) -> None:
        """Find the header. The line that seemed to be the first row may be one."""
        numbers = [k for k, row in self.rows.items() if k > self.start and self._is_row(row)]
        row = self.rows[self.first]
        odd = [cell for k, cell in enumerate(row) if k in self.typical and self._is_odd(k, cell)]
        self.head = self._head(odd if self.start > self.first else None)
        if "names" in self.head[0] and odd and numbers and self.start == self.first:
            self.start = numbers[0]
            self.head = self._head(odd)

    def _cells(self, line: str) -> list[str]:
        try:
            return list(map(bare, self.dialect.cells(line)))
        except csv.Error:
            return []

    def _has_value(self, cell: str) -> bool:
        forms = (DAY, HOUR, DATE)
        known = cell in NOTHING or self._number(cell) is not None
        return known or any(form.fullmatch(cell) for form in forms)

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

    def suggestion(self, ended: bool, unsure: Unsure) -> Suggestion:
        """The keys of a specification."""
        found = vars(self.dialect)
        columns = {key: found[key] for key, usual in vars(Dialect()).items() if found[key] != usual}
        if self.width == 1:
            columns.pop("delimiter", None)
        file, titles = self.head
        self._odd_lines(file, titles, ended, unsure)
        if self.doubt:
            unsure.of("file.below_header", self.doubt)
        if missing := self._missing():
            file["missing_values"] = missing
        body = list(zip(*self._body, strict=True))
        self._check_first(body, unsure)
        self._check_marks([cell for column in body for cell in column], unsure)
        names = [title if title and titles.count(title) == 1 else f"column {k + 1}"
                 for k, title in enumerate(titles)]  # fmt: skip
        units = [unit or (split_title(name)[1] if name == title else "")
                 for unit, name, title in zip(self.units, names, titles, strict=False)]  # fmt: skip
        if time := find_time(names, units, body, self._number, unsure):
            columns = {"time": time, **columns}
            if any(name not in titles for name in _names(time)):
                titles = names
                kept = {"comment", "tail", "missing_values"} & file.keys()
                file = {key: file[key] for key in sorted(kept)} | self._named(names)
        measured = _measured(names, units, body, self._number, unsure)
        measured = [entry for entry in measured if entry["column"] in titles]
        return Suggestion(columns, file, titles, self.rows[self.start], measured)

    def _named(self, titles: list[str]) -> dict[str, Any]:
        """The keys that state titles, and leave out what is above the rows."""
        above = [line for line in self.lines[: self.start] if line.strip()]
        names = [*titles, *[""] * (self.width - len(titles))]
        return {**_skipping(above, self.start), "names": names}

    def _check_first(self, body: Sequence[Sequence[str]], unsure: Unsure) -> None:
        """Say so where all numbers of the first line are far from those below it."""
        columns = [[v for v in map(self._number, cells) if v is not None] for cells in body]
        ends = [(v[0], min(v[3:]), max(v[3:])) for v in columns if len(v) > 3]
        if all(abs(v - high) > 10.0 * (high - low) + abs(high) for v, low, high in ends) and ends:
            problem = "the first line may be no row: all numbers are far from those below"
            unsure.of("file.skip", problem)

    def _check_marks(self, cells: Sequence[str], unsure: Unsure) -> None:
        """Say so where all marks in numbers may be those of thousands."""
        decimal = self.dialect.decimal
        marked = [cell for cell in cells if decimal in cell and self._number(cell) is not None]
        form = re.compile(rf"[+-]?[1-9]\d{{0,2}}\{decimal}\d{{3}}")
        if marked and all(map(form.fullmatch, marked)) and not self.dialect.thousands:
            problem = f"{marked[0]} may have a mark of thousands, too"
            unsure.of("columns.decimal", problem)

    def _fits(self, titles: list[str], odd: list[str] | None = None) -> bool:
        """True if there are as many titles as cells that are not empty throughout.

        Few of them are numbers, but where ``odd`` ones show that it is a header.
        """
        beyond = any(cell for row in self._body for cell in row[len(titles) :])
        known = 0 if odd and set(odd) <= set(titles) else len(titles)
        numbers = sum(self._number(title) is not None for title in titles[:known])
        texts = any(title and not self._is_value(title) for title in titles)
        few = numbers <= 0.2 * len(titles)
        return texts and 0 < len(titles) <= self.width and not beyond and few

    def _head(self, odd: list[str] | None = None) -> tuple[dict[str, Any], list[str]]:
        """The keys that read what is above the rows, and the titles."""
        above = {k: line for k, line in enumerate(self.lines[: self.start]) if line.strip()}
        if above and re.fullmatch(r"sep=[,;\t|]", next(iter(above.values()))):
            del above[next(iter(above))]
        blanks, lowest = self.dialect.delimiter == "whitespace", [*above][-2:]
        # Sentences in comments, too, have as many words.
        likely = [k for k in reversed(above) if not (blanks and sign_of(above[k])) or k in lowest]
        fitting = [k for k in likely if self._fits(self._bare(above[k]), odd)]
        full = [k for k in fitting if _lacks(self._bare(above[k])) < 2]
        fitting = full or fitting  # without a line of Smp, say, below titles and units
        nearest = self._bare(above[max(above)]) if above else []
        if sum(map(bool, nearest)) > self.width and not any(map(self._is_value, nearest)):
            fitting = []  # titles of more columns than rows have
        if len(fitting) > 1 and self._states_units(*(above[k] for k in fitting[1::-1])):
            fitting = fitting[1:]
        numbers = [str(k + 1) for k in range(self.width)]
        if not fitting:
            titled = (self._bare(above[k]) for k in likely)
            titles = [*next(filter(self._are_titles, titled), []), *[""] * self.width]
            names = [a or b for a, b in zip(titles, numbers, strict=False)]
            return self._named(names), names
        k = fitting[0]
        titles, below = self._bare(above[k]), [j for j in above if j > k]
        kinds = [kind_of_line(self._bare(above[j])) for j in below]
        if sign_of(above[k]):
            return self._named(titles), titles
        before = [line for j, line in above.items() if j < k]
        if before and not below and _are_units(self._bare(before[-1]), titles):
            self._take_units(before[-1], len(titles))
        titles, file = self.rows[k][: self.width], _skipping(before, k)
        if below:
            file["below_header"] = ["skip"] * len(below)
        if "units" in kinds:
            last = max(j for j, kind in enumerate(kinds) if kind == "units")
            file["below_header"][last] = "units"
            self._take_units(above[below[last]], len(titles))
        return file, titles

    def _are_titles(self, cells: list[str]) -> bool:
        """True if cells may name the columns, though not all of them, or too many."""
        texts, width = [cell for cell in cells if cell], self.width
        several = 0.5 * width < len(texts) == len(set(texts)) and len(cells) >= width - 1
        return several and not any(map(self._is_value, texts))

    def _take_units(self, line: str, count: int) -> None:
        """Take the units in a line, if there may be one for each title of a number of them."""
        cells = self._cells(line[len(sign_of(line)) :].strip(" "))
        if len(cells) >= count:
            self.units = [*map(unbracketed, cells), *[""] * self.width][: self.width]

    def _states_units(self, upper: str, lower: str) -> bool:
        """True if the lower one of two lines that fit seems to have the units of the other."""
        titles, units = self._bare(upper), self._bare(lower)
        alike = bool(sign_of(upper)) == bool(sign_of(lower))
        known = all(unit == "-" or readings(unit) for unit in filter(None, units))
        if kind_of_line(units) != "units" or _are_units(titles, units):
            return False
        if not (alike and known):
            self.doubt = f"{lower!r} may have titles, or units of those above it"
        return True

    def _bare(self, line: str) -> list[str]:
        """The cells of a line without the sign of a comment."""
        cells = self._cells(line[len(sign_of(line)) :].strip(" "))
        while cells and not cells[-1]:
            del cells[-1]
        return cells

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
            if sign := sign_of(self.lines[k]):
                file.setdefault("comment", sign)
            elif cells == titles and "names" not in file:
                file["repeated_header"] = "skip"
            elif k == last:
                file["tail"] = "drop"
            elif len(cells) != self.width:
                odd.append(k)
        begins = {self.rows[k][0].split(" ")[0]: len(self.rows[k]) for k in odd}
        if odd:
            problem = f"{len(odd)} lines have another number of cells than rows, {self.width}"
            unsure.of("file.comment", f"{problem}; the first one is line {odd[0] + 1}")
        if list(begins.values()) == [1] and (word := next(iter(begins))).isalpha():
            file.setdefault("comment", word)
        kinds = {**dict.fromkeys(row[0] for row in self._body), **begins}
        if max(begins.values(), default=0) > 1 and 1 < len(kinds) <= _MOST_TEXTS:
            named = titles[0] if titles else "1"
            listed = " or ".join(map(repr, kinds))
            unsure.of("file.where", f"{named!r} is {listed}; rows of each have their own columns")
        before = [k for k, row in self.rows.items() if k < self.start and self._is_row(row)]
        if len(before) > 10:
            problem = f"{len(before)} lines above line {self.start + 1} look like rows, too"
            unsure.of("file.skip", problem)

    def _missing(self) -> list[str]:
        """Texts that stand where other rows have values."""
        texts: dict[str, None] = {}
        *body, last = self._body
        for column in zip(*body, *[last] * self._is_row(last), strict=True):
            odd = [cell for cell in column if not self._is_value(cell)]
            if len(odd) < 0.5 * sum(map(bool, column)) and len(set(odd)) <= _MOST_TEXTS:
                texts.update(dict.fromkeys(odd))
        return list(texts)[:20]
