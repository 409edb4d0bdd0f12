"""Columns of a record, and the conversion of cells into the observer's numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, nearest, shown
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dates import ISO, looks_dated
from reobserve.estimation.families.design import Design
from reobserve.estimation.quantities import SAME, Conversion, check_unit, conversion
from reobserve.estimation.specification import Column, Columns

Array = NDArray[np.float64]

_TITLE = re.compile(r"(.*?)\s*\[([^\[\]]*)\]\s*")
_DATED = re.compile(r"\d{1,4}[./-]\d\d?[./-]\d{2,4} \d")
_DECIMAL = re.compile(r"[+-]?\d*@\d+([eE][+-]?\d+)?")
NOTHING = ("", "nan", "NaN", "NAN", "NA", "N/A", "null", "None", "-")


@dataclass(frozen=True)
class Layout:
    """The columns to read, time first if there is one, then y, then u.

    ``titles`` are those of the header, ``names`` without units. ``units`` are those that the
    observer reads, in which ranges are meant no more: these are in the file's. Where the time is
    ``dated``, its cells are dates, whose times are given for them.
    """

    titles: tuple[str, ...]
    names: tuple[str, ...]
    conversions: tuple[Conversion, ...]
    units: tuple[str, ...]
    ranges: tuple[tuple[float, float] | None, ...]
    lost_at_range: tuple[bool, ...]
    timed: bool
    measurements: int
    decimal: str
    dated: bool = False
    format: str = ""
    periods: tuple[float, ...] = ()  # of angles, in the observer's units, zero for others

    def values(self, raw: Array, report: DataReport) -> tuple[Array, Array]:
        """Times [s], empty without a column for them, and y and u, from the cells of rows.

        Raises
        ------
        InputError
            If a cell is infinite.
        """
        if np.isinf(raw).any():
            row, column = np.argwhere(np.isinf(raw))[0]
            raise InputError(
                self.titles[column],
                f"row {report.rows + row + 1} is {raw[row, column]}, must be a number, or empty "
                "if it is missing",
            )
        columns = [self._column(raw[:, c].copy(), c, report) for c in range(raw.shape[1])]
        time = columns[0] if self.timed else np.empty(0)
        values = np.column_stack(columns[self.timed :])
        lost = np.isnan(values).sum(axis=0)
        if lost.any():
            for name, count in zip(self.names[self.timed :], lost, strict=True):
                report.count(report.missing, name, count)
        return time, values

    def _column(self, cells: Array, c: int, report: DataReport) -> Array:
        limits = self.ranges[c]
        if limits is not None:
            outside = (cells <= limits[0]) | (cells >= limits[1])
            report.count(report.saturated, self.names[c], outside.sum())
            if self.lost_at_range[c]:
                cells[outside] = np.nan
        converted: Array = self.conversions[c].of(cells)
        if self.periods and self.periods[c]:
            return _unwrapped(converted, self.periods[c], report.angles, self.names[c])
        return converted

    def number(self, cell: str, row: int, column: int) -> float:
        """The number that a cell of text spells, or nan if there is none.

        Raises
        ------
        InputError
            If it spells something else.
        """
        text = cell.strip().strip('"')
        if self.decimal == ",":
            text = text.replace(",", ".")
        try:
            if "_" in text:
                raise ValueError
            value = float(text)
        except ValueError:
            if text in NOTHING:
                return math.nan
            problem = no_number(row, cell, text, self.decimal)
            raise InputError(self.titles[column], problem) from None
        return value


def _unwrapped(angles: Array, period: float, before: dict[str, list[float]], name: str) -> Array:
    """Angles that go on beyond a turn, the shortest way from each to the next that is known."""
    known = np.flatnonzero(np.isfinite(angles))
    if len(known):
        last, turns = before.get(name, [float(angles[known[0]]), 0.0])
        steps = np.diff(np.concatenate([[last], angles[known]]))
        total = turns - np.cumsum(np.floor(steps / period + 0.5))
        before[name] = [float(angles[known[-1]]), float(total[-1])]
        angles[known] += period * total
    return angles


def no_number(row: int, cell: str, text: str, decimal: str = ".") -> str:
    """A message on a cell that spells no number, with the key that would read it."""
    hint, other = "", "," if decimal == "." else "."
    if looks_dated(text):
        hint = f"; of dates the unit is {ISO}"
    elif _DATED.match(text):
        hint = '; of dates state columns.time.format, as "%d.%m.%Y %H:%M:%S"'
    elif _DECIMAL.fullmatch(cell.strip().strip('"').replace(other, "@", 1)):
        hint = f'; state columns.decimal: "{other}"'
    return f"row {row} is {shown(cell)}, must be a number{hint}"


def lay_out(columns: Columns, design: Design, header: Sequence[str], place: str) -> Layout:
    """Find the columns in a header, ``name`` or ``name [unit]``, and settle their units.

    Raises
    ------
    InputError
        If there is no such column, or two; if the observer reads another number of them; or if
        units are unknown, are not those of the header, or cannot become those of the model.
    """
    if len(header) == 1:
        others = [one for one in ",;\t" if one != columns.delimiter and one in header[0]]
        if others and header[0] not in {one.column for one in columns.measurements}:
            raise InputError(
                "columns.delimiter",
                f"{shown(columns.delimiter)} is not in the header of {place}, {shown(header[0])}; "
                f"it may be {' or '.join(map(repr, others))}",
            )
    for title in header:
        if list(header).count(title) > 1:
            raise InputError(place, f"has the column {shown(title)} twice")
    wanted: list[tuple[str, Column, str]] = []
    for what, given, widths, signals in (
        ("measurements", columns.measurements, design.widths[0], design.measurements),
        ("inputs", columns.inputs, design.widths[1], design.inputs),
    ):
        fixed = [unit for _, unit in signals] if all(unit for _, unit in signals) else []
        if len(given) not in widths:
            counts = " or ".join(map(str, widths))
            problem = f"are {len(given)} columns, the observer reads {counts}"
            raise InputError(f"columns.{what}", problem)
        for k, column in enumerate(given):
            wanted.append((f"columns.{what}.{k}", column, fixed[k] if fixed else ""))
    parts = [find_column(at, column, fixed, header, place) for at, column, fixed in wanted]
    every = [column for _, column, _ in wanted]
    timed, dated = bool(columns.time.column), False
    if timed:
        unit = columns.time.dated
        clock = Column(columns.time.column, "" if unit == ISO else unit)
        title, unit = _title("columns.time", clock, header, place)
        dated = ISO in (columns.time.dated, unit)
        way = SAME if dated else conversion("columns.time.unit", unit or "s", "s")
        parts.insert(0, (title, way, "s"))
        every.insert(0, clock)
    return Layout(
        tuple(part[0] for part in parts), tuple(column.column for column in every),
        tuple(part[1] for part in parts), tuple(part[2] for part in parts),
        tuple(column.range for column in every),
        tuple(column.saturated == "missing" for column in every), timed,
        len(columns.measurements), columns.decimal, dated, columns.time.format,
        tuple(
            0.0 if column.wrap is None else abs(part[1].factor) * column.wrap
            for column, part in zip(every, parts, strict=True)
        ),
    )  # fmt: skip


def _title(at: str, column: Column, header: Sequence[str], place: str) -> tuple[str, str]:
    """The title of a column in the header, and its unit there or in the specification."""
    split = {title: _TITLE.fullmatch(title) for title in header}
    found = [
        title for title in header
        if title.strip() == column.column
        or ((match := split[title]) is not None and match[1].strip() == column.column)
    ]  # fmt: skip
    if len(found) != 1:
        names = [match[1] if (match := split[title]) else title for title in header]
        problem = "has two columns" if found else "has no column"
        ending = "" if found else nearest(column.column, names)
        raise InputError(f"{at}.column", f"{place} {problem} {shown(column.column)}{ending}")
    match = split[found[0]]
    said = match[2].strip() if match is not None and match[1].strip() == column.column else ""
    if said and column.unit and said != column.unit:
        same = conversion(f"{at}.unit", said, column.unit)
        if same != SAME:
            problem = f"says {column.unit}, the header of {place} says {said}"
            raise InputError(f"{at}.unit", problem)
    return found[0], column.unit or said


def find_column(
    at: str, column: Column, fixed: str, header: Sequence[str], place: str
) -> tuple[str, Conversion, str]:
    """A column's title in the header, its conversion, and its unit then (raises as `lay_out`)."""
    title, unit = _title(at, column, header, place)
    if unit:
        check_unit(f"{at}.unit", unit)
    if fixed and column.model_unit and conversion(at, column.model_unit, fixed) != SAME:
        problem = f"{column.model_unit} must be {fixed}, in which this observer reads"
        raise InputError(f"{at}.model_unit", problem)
    model = fixed or column.model_unit
    way = conversion(f"{at}.unit", unit, model) if model and unit else SAME
    if column.offset is not None:  # of a deviation, a scale's own zero cancels
        way = Conversion(way.factor, 0.0, column.offset)
    return title, way, model or unit
