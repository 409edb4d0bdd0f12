"""Columns of a record, and the conversion of cells into the observer's numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, ProblemsError, nearest, shown
from reobserve.core.units import check_unit, readings
from reobserve.estimation.clock import Clock, Dates
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dates import DURATION, ISO
from reobserve.estimation.observer_design import Design
from reobserve.estimation.quantities import SAME, Conversion, agree, conversion
from reobserve.estimation.refusals import RowError
from reobserve.estimation.specification import Column, Columns, Constant, TimeColumn

Array = NDArray[np.float64]

_NO_HEADER = (
    "; file.skip, comment, header or names state where titles are, and columns.delimiter what is "
    "between them: `reobserve estimate --suggest` finds all of these"
)
# Titles that end in a unit: name [unit], name (unit), name, unit and name / unit.
_BRACKETS = re.compile(r"(.*?)\s*(?:\[([^\[\]]*)\]|\(((?:[^()]|\([^()]*\))*)\))\s*")
_COMMA = re.compile(r"(.*[^\s,])\s*,\s*([^\s,].*)")
_INDEX = re.compile(r".*\S(\[\d+\]|\(\d+\))\s*")  # as in gyro[1], which is no unit
_STROKE = re.compile(r"([^/]*[^\s/])\s*/\s*([^\s/].*)")


@dataclass(frozen=True)
class Layout:
    """The columns to read, time first if there is one, then y, then u.

    ``titles`` are those of the header. ``units`` are those that the observer reads, while ranges
    and periods are in the file's. Of timestamps, the cells are times by the ``clock``, less what
    these count from.
    """

    titles: tuple[str, ...]
    columns: tuple[Column, ...]
    conversions: tuple[Conversion, ...]
    units: tuple[str, ...]
    measurements: int
    clock: Clock | None

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The names of the columns, without units."""
        return tuple(column.column for column in self.columns)

    @property
    def timed(self) -> bool:
        """True if there are timestamps."""
        return self.clock is not None

    def _check_counter(self, raw: Array, report: DataReport) -> None:
        """Refuse rows whose counter is not below the number at which it begins again."""
        if self.clock is None or (wrap := self.columns[0].wrap) is None:
            return
        numbers = raw[:, 0] + self.clock.epoch(report)
        beyond = np.flatnonzero((numbers < 0.0) | (numbers >= wrap))
        if len(beyond):
            rows, key = report.rows + beyond + 1, "columns.time.wrap"
            problem = f"{wrap:.15g} must be above {numbers[beyond[0]]:.15g}, as {{at}} has"
            report.refusals.refuse((key,), lambda: RowError(key, problem, int(rows[0])), rows)
            report.refusals.leave_out(rows)
            raw[beyond, 0] = np.nan

    def times(self, raw: Array, report: DataReport) -> Array:
        """Times [s] from the cells of rows, as `values` has them."""
        return self._column(raw[:, 0].copy(), 0, report)

    def values(self, raw: Array, report: DataReport) -> tuple[Array, Array]:
        """Times [s], empty without a column for them, and y and u, from the cells of rows.

        Raises
        ------
        InputError
            If a cell is infinite.
        """
        infinite = np.isinf(raw)
        if infinite.any():
            for column in np.flatnonzero(infinite.any(axis=0)).tolist():
                at, title = np.flatnonzero(infinite[:, column]), self.titles[column]
                rows, value = report.rows + at + 1, raw[at[0], column]
                problem = f"{{at}} is {value}, must be a number, or empty if it is missing"
                error = RowError(title, problem, int(rows[0]))
                report.refusals.refuse((title, "infinite"), error, rows)
                report.refusals.leave_out(rows)
            raw = np.where(infinite, np.nan, raw)
        self._check_counter(raw, report)
        columns = [self._column(raw[:, c].copy(), c, report) for c in range(raw.shape[1])]
        time = columns[0] if self.timed else np.empty(0)
        return time, np.column_stack(columns[self.timed :])

    def fill(self, values: Array, report: DataReport) -> None:
        """Put the last value into empty cells of columns that hold it, and count the others."""
        for c, column in enumerate(self.columns[self.timed :]):
            if column.missing == "hold":
                values[:, c] = _held(values[:, c], report, column.column)
            report.count(report.missing, column.column, np.isnan(values[:, c]).sum())

    def _column(self, cells: Array, c: int, report: DataReport) -> Array:
        column, way = self.columns[c], self.conversions[c]
        if column.range is not None:
            outside = (cells <= column.range[0]) | (cells >= column.range[1])
            report.count(report.saturated, column.column, outside.sum())
            if column.saturated == "missing":
                cells[outside] = np.nan
        converted: Array = way.of(cells)
        if column.wrap is not None:
            period = abs(way.factor) * column.wrap
            return _unwrapped(converted, period, report.angles, column.column)
        return converted


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


def _held(values: Array, report: DataReport, name: str) -> Array:
    """Values of which the last one holds where there is none."""
    known = np.isfinite(values)
    every = np.concatenate([[report.levels.get(name, np.nan)], values])
    last = np.maximum.accumulate(np.where(np.isfinite(every), np.arange(len(every)), 0))[1:]
    filled: Array = every[last]
    report.count(report.held, name, (np.isfinite(filled) & ~known).sum())
    if len(filled) and np.isfinite(filled[-1]):
        report.levels[name] = float(filled[-1])
    return filled


def lay_out(
    columns: Columns, design: Design, header: Sequence[str], place: str, period: float = 0.0
) -> Layout:
    """Find the columns in a header, ``name`` or ``name [unit]``, say, and settle their units.

    Raises
    ------
    InputError
        With all columns that are not there, or whose units are not clear.
    """
    wanted = _wanted(columns, design)
    parts, problems, clock = [], list[InputError](), None
    for at, column, fixed in wanted:
        try:
            parts.append(find_column(at, column, fixed, header, place))
        except InputError as error:
            problems.append(error)
    try:
        clock = _clock(columns.time, header, place, period)
    except InputError as error:
        problems.append(error)
    names = {*columns.time.columns, *(column.column for column in columns.read)} - {""}
    if problems and not any(_matches(name, header) for name in names):
        problem, *nearest_title = problems[0].problem.split("; did you")
        if len(header) == 1 or not nearest_title:
            problems = [InputError(problems[0].parameter, problem + _NO_HEADER)]
    if problems:
        raise problems[0] if len(problems) == 1 else ProblemsError(problems)
    every = [column for _, column, _ in wanted]
    if clock is not None:
        parts.insert(0, (clock.titles[0], clock.way, "s"))
        every.insert(0, Column(clock.titles[0], wrap=columns.time.wrap))
    for title in (*(part[0] for part in parts), *(clock.titles if clock else ())):
        if list(header).count(title) > 1:
            problem = f"has the column {shown(title)} twice"
            raise InputError(place, f"{problem}; file.skip and file.names may state other titles")
    titles, ways, units = zip(*parts, strict=True)
    return Layout(titles, tuple(every), ways, units, len(columns.measurements), clock)


def _wanted(columns: Columns, design: Design) -> list[tuple[str, Column, str]]:
    """The columns to read: their keys, they themselves, and the unit that the observer states."""
    wanted: list[tuple[str, Column, str]] = []
    for what, entries, widths, signals in (
        ("measurements", columns.measurements, design.widths[0], design.measurements),
        ("inputs", columns.inputs, design.widths[1], design.inputs),
    ):
        fixed = [unit for _, unit in signals] if all(unit for _, unit in signals) else []
        if len(entries) not in widths:
            counts = " or ".join(map(str, widths))
            problem = f"are {len(entries)} columns, the observer reads {counts}"
            raise InputError(f"columns.{what}", problem)
        for k, column in enumerate(entries):
            if isinstance(column, Constant):
                continue
            wanted.append((f"columns.{what}.{k}", column, fixed[k] if fixed else ""))
    return wanted


def _clock(time: TimeColumn, header: Sequence[str], place: str, period: float) -> Clock | None:
    """The columns of timestamps and the way they are written, None if there are none."""
    if not time.columns:
        return None
    dated, elapsed = time.dated in (ISO, DURATION), time.unit == DURATION
    columns = [
        _title("columns.time", Column(name, "" if dated else time.unit), header, place, dated)
        for name in time.columns
    ]
    titles, units = tuple(title for title, _ in columns), [unit for _, unit in columns]
    if ISO in units and not elapsed:
        return Clock(titles, SAME, Dates(time.format, time.zone, period, time.day))
    for key, is_set in (("column", len(titles) > 1), ("zone", time.zone)):
        if is_set:
            problem = "several columns are" if key == "column" else f"{time.zone} is"
            raise InputError(
                f"columns.time.{key}", f"{problem} for dates, which have a format, or unit: {ISO}"
            )
    way = SAME if elapsed else conversion("columns.time.unit", units[0] or "s", "s")
    return Clock(titles, way, elapsed=elapsed)


def split_title(title: str) -> tuple[str, str]:
    """The name in a title, and what ends it as a unit does."""
    if _INDEX.fullmatch(title):
        return title.strip(), ""
    for form in (_BRACKETS, _COMMA, _STROKE):
        if (match := form.fullmatch(title.strip())) is not None:
            name, *units = match.groups()
            return name.rstrip(" \t/,"), next(unit.strip() for unit in units if unit is not None)
    return title.strip(), ""


def _title(
    at: str, column: Column, header: Sequence[str], place: str, dated: bool = False
) -> tuple[str, str]:
    """The title of a column in the header, and its unit there or in the specification."""
    parts = {title: split_title(title) for title in header}
    whole = list(dict.fromkeys(text for text in header if text.strip() == column.column))
    matches = whole or _matches(column.column, header)
    if not matches and _matches(column.column, [header[0].lstrip("#% ")]):
        matches = list(header[:1])  # which begins as a comment
    if len(matches) != 1:
        problem = "has two columns" if matches else "has no column"
        ending = "" if matches else nearest(column.column, [name for name, _ in parts.values()])
        raise InputError(f"{at}.column", f"{place} {problem} {shown(column.column)}{ending}")
    title, (name, said) = matches[0], parts[matches[0]]
    unit = bool(whole and "/" in title and readings(title.strip()))  # as km/h
    if dated:
        return title, ISO
    if column.unit:
        if said and not (agree(said, column.unit) or (unit and agree(title, column.unit))):
            problem = f"says {column.unit}, the header of {place} says {said}"
            raise InputError(f"{at}.unit", problem)
        return title, column.unit
    if said and said != ISO:
        if unit:
            problem = f"is missing: the title {shown(title)} may be a unit, or {name} in {said}"
            raise InputError(f"{at}.unit", problem)
        if not readings(said):
            raise InputError(
                f"{at}.unit",
                f"is missing: the title {shown(title)} of {place} ends in {shown(said)}, which is "
                "no unit that is known; it is '1', in quotes, for a number without a unit",
            )
    return title, said


def _matches(name: str, header: Sequence[str]) -> list[str]:
    """The titles that are a name, or a name with a unit."""
    return list(dict.fromkeys(
        title for title in header if title.strip() == name or split_title(title)[0] == name
    ))  # fmt: skip


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
