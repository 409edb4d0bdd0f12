"""A check of a record: all that refuses it, and the lines of a specification that would accept it.

The record is read to its end whatever is wrong. Where a key would read on, the check goes on as if
it were stated, so that the next refusal is found, too. The specification is not changed.
"""

from __future__ import annotations

import copy
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.documents import read_yaml
from reobserve.core.errors import DivergenceError, InputError
from reobserve.core.validation import parse
from reobserve.estimation.dialect import Dialect
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.layout import ColumnsError
from reobserve.estimation.reading import BLOCK, File, lines_of
from reobserve.estimation.report_table import as_table
from reobserve.estimation.specification import Specification, read_specification
from reobserve.estimation.suggestion import SIGNS, Suggestion, dumped, suggest
from reobserve.estimation.text_rows import RowError, TextRows
from reobserve.estimation.timestamps import UnevenError, least_jitter

Array = NDArray[np.float64]

_MOST_LISTED = 20
_MOST_TRIES = 12
_LATE = 0.25  # periods by which a sample that is taken on time may be stamped late
_ROWS = 100_000  # in a block
_DIALECT = ("delimiter", "decimal", "thousands", "encoding")


@dataclass
class Findings:
    """The refusals of a record by their sentences, with how often and why they occur.

    ``tree`` is the specification with the keys that would accept it, as far as there are any.
    """

    tree: dict[str, Any]
    refusals: dict[str, int] = field(default_factory=dict)
    final: bool = False  # something is wrong that no key accepts
    changed: list[str] = field(default_factory=list)  # sections of the tree
    summary: str = ""

    def refuse(self, error: InputError, key: str = "") -> None:
        """Take a refusal, which counts with all that have the same ``key``."""
        for known in self.refusals:
            if key and known.startswith(key + "\0"):
                self.refusals[known] += 1
                return
        if str(error) not in {one.partition("\0")[2] for one in self.refusals}:
            self.refusals[f"{key}\0{error}"] = 1

    def state(self, section: str, **keys: Any) -> bool:
        """Put keys into a section of the tree, and return whether that changes it."""
        before = self.tree.get(section, {})
        changed = any(before.get(key) != value for key, value in keys.items())
        if changed:
            self.tree[section] = {**before, **keys}
            self.changed = list(dict.fromkeys([*self.changed, section]))
        return changed

    def text(self, place: str) -> str:
        """The refusals, one in a line, and the lines to paste."""
        if not self.refusals:
            return f"{place} is accepted\n{self.summary}"
        lines = []
        for told, count in list(self.refusals.items())[:_MOST_LISTED]:
            times = f" ({count} times)" if count > 1 else ""
            lines.append(f"{told.partition(chr(0))[2]}{times}")
        if (more := len(self.refusals) - _MOST_LISTED) > 0:
            lines.append(f"and {more} more")
        if self.final or not self.changed:
            lines += ["", "no key accepts all of this"]
        if self.changed:
            what = "the rest" if self.final else "the record"
            lines += ["", f"stated as follows, these sections of the specification accept {what}:"]
            lines += ["", dumped({key: self.tree[key] for key in self.changed}), ""]
        return "\n".join([*lines, self.summary])


def check(specification: Path, data: Path) -> Findings:
    """What refuses a record, and what would accept it.

    Raises
    ------
    InputError
        If the specification is refused whatever the record is, or the file cannot be read.
    """
    read_specification(specification)
    found = Findings(copy.deepcopy(read_yaml(specification)))
    for _ in range(_MOST_TRIES):
        made = _made(found, data)
        if made is None:
            return found
        again, cells, lines = _read(found, made, data)
        if not (again or _sample(found, made, cells, lines)):
            return found
    found.final = True
    return found


def _made(found: Findings, data: Path) -> Estimation | None:
    """The estimation by a layout that finds the columns, if a layout does."""
    for _ in range(_MOST_TRIES):
        stated = parse(Specification, found.tree)
        file = File(data, Dialect.of(stated))
        try:
            return Estimation(stated, file.header(), str(data))
        except InputError as error:
            if error.parameter.startswith("observer"):
                raise
            for problem in error.problems if isinstance(error, ColumnsError) else [error]:
                found.refuse(problem)
            if not _lay_out(found, error, data):
                found.final = True
                return None
    return None


def _lay_out(found: Findings, error: InputError, data: Path) -> bool:
    """State what may mend a layout, and return whether that is anything new."""
    if error.parameter in ("sampling.missing", "sampling.at_gap"):
        key = error.parameter.partition(".")[2]
        return found.state("sampling", **{key: "interpolate" if key == "missing" else "restart"})
    if error.parameter.endswith(".unit"):
        return False
    return _guess(found, data)


def _guess(found: Findings, data: Path) -> bool:
    """State the layout that the text seems to have, and return whether it is another one."""
    try:
        guess: Suggestion = suggest(data)
    except InputError:
        return False
    usual = vars(Dialect())
    columns = {key: guess.columns.get(key, usual[key]) for key in _DIALECT}
    columns = {
        key: value
        for key, value in columns.items()
        if value != found.tree["columns"].get(key, usual[key])
    }
    changed = bool(columns) and found.state("columns", **columns)
    return bool(guess.file and found.state("file", **guess.file)) or changed


def _read(found: Findings, made: Estimation, data: Path) -> tuple[bool, list[Array], list[int]]:
    """The cells of all rows and their lines, and whether they are to be read by other keys."""
    file = File(data, Dialect.of(made.specification))
    layout = made.layout
    if file.columnar:
        return False, list(file.blocks(layout.titles, layout.clock, made.report)), []
    head = file.head()
    rows = file.rows(head, layout.titles, layout.clock, made.report)
    blocks, numbers, lines = list[Array](), list[list[float]](), list[int]()
    again, odd = False, 0
    for above, text in file.texts(head.lines, BLOCK):
        rows.line = above
        for line in lines_of(text):
            try:
                row = rows.row(line)
                cells = None if row is None else rows.cells(row)
            except InputError as error:
                again, odd = _refuse_line(found, rows, line, error) or again, rows.line
                continue
            if cells is None:
                continue
            values, good = [], True
            for column in range(len(layout.titles)):
                try:
                    values.append(rows.number(column, cells))
                except InputError as error:
                    again = _refuse_cell(found, rows, column, cells, error) or again
                    values.append(np.nan)
                    good = good and not (column == 0 and layout.timed)
            if good:
                numbers.append(values)
                lines.append(rows.line)
                if len(numbers) == _ROWS:
                    blocks.append(np.array(numbers))
                    numbers = []
    rows.finish()
    if odd and odd == rows.line and not again:
        again = found.state("file", tail="drop")
    elif odd and not again:
        found.final = True
    return again, blocks + ([np.array(numbers)] if numbers else []), lines


def _refuse_line(found: Findings, rows: TextRows, line: str, error: InputError) -> bool:
    """Take a line with another number of cells, and return whether a key reads on."""
    found.refuse(error, "cells")
    if rows.ended and (sign := next((s for s in SIGNS if line.startswith(s)), "")):
        return found.state("file", comment=sign)
    return not rows.ended and found.state("file", tail="drop")


def _refuse_cell(
    found: Findings, rows: TextRows, column: int, cells: list[str], error: InputError
) -> bool:
    """Take a cell that is no number, and return whether a key reads on."""
    cell = cells[rows.places[column]].strip().strip('"').strip()
    found.refuse(error, f"{column} {cell}" if not cell[:1].isdigit() else f"{column}")
    stated = found.tree.get("file", {})
    if rows.repeats:
        return found.state("file", repeated_header="skip")
    if not rows.ended:
        return found.state("file", tail="drop")
    first = rows.is_first and not any(one.strip()[:1].isdigit() for one in cells)
    if first and "below_header" not in stated and not stated.get("names"):
        return found.state("file", below_header=["units"])
    if cell[:1].isdigit() or (column == 0 and rows.clock is not None):
        found.final = found.final or not (guessed := _guess_marks(found, rows))
        return guessed
    texts = dict.fromkeys([*stated.get("missing_values", []), cell])
    return found.state("file", missing_values=list(texts))


def _guess_marks(found: Findings, rows: TextRows) -> bool:
    """State the marks, and the way dates are written, that the text seems to have."""
    guess = suggest(Path(rows.place))
    keys = {key: guess.columns[key] for key in _DIALECT if key in guess.columns}
    time, stated = guess.columns.get("time", {}), found.tree["columns"].get("time", {})
    if time.get("column") == stated.get("column") and (time.get("format") or time.get("unit")):
        keys["time"] = {**{k: v for k, v in stated.items() if k != "unit"}, **time}
    return bool(keys) and found.state("columns", **keys)


def _sample(found: Findings, made: Estimation, cells: list[Array], lines: list[int]) -> bool:
    """Find policies of sampling that accept the rows, and run the observer by them.

    Return whether the rows are to be read again, as their times mean something else.
    """
    read = copy.copy(made.report)
    for _ in range(_MOST_TRIES):
        made.specification = parse(Specification, found.tree)
        made.prepare()
        made.report.origin, made.report.zone = read.origin, read.zone
        made.report.shift, made.report.left_out = read.shift, read.left_out
        try:
            for block in cells:
                made.gaps.feed(made.slots(block.copy()), False)
            *waiting, last = made.last_slots()
            for rows in waiting:
                made.gaps.feed(rows, False)
            made.gaps.feed(last, True)
        except RowError as error:
            row = error.row
            found.refuse(error.at_line(lines[row - 1] if lines else None))
            if _accept_clock(found, made, error):
                return True
            if not _accept(found, made, error, cells):
                _leave_out(found, cells, lines, row)
        except InputError as error:
            found.refuse(error)
            if not _accept(found, made, error, cells):
                break
        else:
            _run(found, made, cells)
            return False
    found.final = True
    return False


def _leave_out(found: Findings, cells: list[Array], lines: list[int], row: int) -> None:
    """Go on without a row that no key accepts."""
    found.final = True
    for k, block in enumerate(cells):
        if row <= len(block):
            cells[k] = np.delete(block, row - 1, axis=0)
            break
        row -= len(block)
    del lines[row - 1 : row]


def _accept(found: Findings, made: Estimation, error: InputError, cells: list[Array]) -> bool:
    """State the policy by which a refused row is accepted, and return whether there is one."""
    said, can_skip = str(error), made.can_skip
    keys: dict[str, Any] = {}
    if isinstance(error, UnevenError) or error.parameter == "sampling.period":
        keys = _period(made, cells, isinstance(error, UnevenError))
    elif "sampling.repeated" in said:
        times = np.concatenate([block[:, 0] for block in cells])
        shared = np.count_nonzero(np.diff(times) == 0) > 0.5 * len(times)
        keys = {"repeated": "spread" if shared else "first"}
    elif "sampling.at_gap is" in said:
        keys = {"at_gap": "coast" if can_skip else "restart"}
    elif "sampling.missing is" in said:
        keys = {"missing": "skip" if can_skip else "interpolate"}
    elif "are coasted over" in said:
        keys = {"at_gap": "restart"}
    return bool(keys) and found.state("sampling", **keys)


def _accept_clock(found: Findings, made: Estimation, error: InputError) -> bool:
    """State what the time of a refused row means, and return whether that may mend it."""
    time, clock = found.tree["columns"].get("time", {}), made.layout.clock
    if error.parameter == "columns.time.zone":
        zone = re.search(r"put forward in (\S+);", str(error))
        return zone is not None and found.state("columns", time={**time, "zone": zone[1]})
    if clock is None or clock.dates is None or "sampling.repeated" not in str(error):
        return False
    if "%H" in clock.dates.format or "%I" in clock.dates.format or len(clock.titles) > 1:
        return False
    guess = suggest(Path(made.place)).columns.get("time", {})
    both = isinstance(guess.get("column"), list) and time.get("column") in guess["column"]
    return both and found.state("columns", time=guess)


def _period(made: Estimation, cells: list[Array], uneven: bool) -> dict[str, Any]:
    """The jitter, the period or the resampling that accepts the timestamps."""
    way = made.layout.conversions[0]
    times = [np.asarray(way.of(block[:, 0])) for block in cells]
    steps = np.diff(np.concatenate(times))
    median = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    stated = made.specification.sampling
    first, mean = least_jitter(iter(times), stated.period)
    periods = {stated.period: first} if uneven else {}
    for one in (mean, median):
        if one:
            period = float(f"{one:.6g}")
            periods[period] = least_jitter(iter(times), period)[0]
    for period, least in periods.items():
        if least is not None and least <= _LATE:
            keys: dict[str, Any] = {} if period == stated.period else {"period": period}
            return {**keys, **({"jitter": least} if least > stated.jitter else {})}
    keys = {} if 0.1 * stated.period <= median <= 10.0 * stated.period else {
        "period": float(f"{median:.6g}")
    }  # fmt: skip
    return {**keys, "uneven": "linear"}


def _run(found: Findings, made: Estimation, cells: list[Array]) -> None:
    """Run the observer over the rows, for the summary of what `estimate` would do."""
    left_out, report = made.report.left_out, made.report
    made.prepare()
    made.report.origin, made.report.zone = report.origin, report.zone
    made.report.shift, made.report.left_out = report.shift, left_out
    made.alarms.clear()
    try:
        for block in cells:
            made.feed(block)
        made.finish()
        if not made.report.estimates:
            found.refuse(InputError(made.place, "has no row from which the observer could start"))
            found.final = True
    except DivergenceError as error:
        found.refuse(InputError(made.place, str(error)))
        found.final = True
    found.summary = as_table(made.report, made.specification.sampling.period)
