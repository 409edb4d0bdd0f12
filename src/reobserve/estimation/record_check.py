"""A check of a record: all that refuses it, and the lines of a specification that would accept it.

The record is read to its end whatever is wrong. Where a key would read on, the check goes on as if
it were stated, so that the next refusal is found, too. The specification is not changed.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reobserve.core.documents import read_yaml
from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve.estimation.dialect import Dialect, bare
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.findings import Findings
from reobserve.estimation.layout import ColumnsError
from reobserve.estimation.record_file import BLOCK, File, lines_of
from reobserve.estimation.sampling_check import sample
from reobserve.estimation.specification import Specification, read_specification
from reobserve.estimation.suggested_time import HOUR
from reobserve.estimation.suggestion import kind_of_line, sign_of
from reobserve.estimation.text_rows import TextRows

Array = NDArray[np.float64]

_MOST_TRIES = 12
_ROWS = 100_000  # in a block
_DIALECT = ("delimiter", "decimal", "thousands", "encoding")


def check(specification: Path, data: Path) -> Findings:
    """Everything that refuses a record, and what would accept it."""
    read_specification(specification)
    tree = read_yaml(specification)
    findings = Findings(copy.deepcopy(tree), data, stated=tree)
    for _ in range(_MOST_TRIES):
        made = _made(findings, data)
        if made is None:
            findings.changed = []  # which do not find the columns
            return findings
        again, cells, lines = _read(findings, made, data)
        if not (again or sample(findings, made, cells, lines)):
            return findings
    findings.final = True
    return findings


def _made(findings: Findings, data: Path) -> Estimation | None:
    """The estimation by a layout that finds the columns, if a layout does."""
    for _ in range(_MOST_TRIES):
        specification = parse(Specification, findings.tree)
        file = File(data, Dialect.of(specification))
        try:
            return Estimation(specification, file.header(), str(data))
        except InputError as error:
            if error.parameter.startswith("observer"):
                raise
            for problem in error.problems if isinstance(error, ColumnsError) else [error]:
                findings.refuse(problem)
            if not _lay_out(findings, error):
                findings.final = True
                return None
    return None


def _lay_out(findings: Findings, error: InputError) -> bool:
    """State what may mend a layout, and return whether that is anything new."""
    if error.parameter in ("sampling.missing", "sampling.at_gap"):
        key = error.parameter.partition(".")[2]
        return findings.state("sampling", **{key: "interpolate" if key == "missing" else "restart"})
    if error.parameter == "columns.time.unit":
        time = findings.tree["columns"].get("time", {})
        guess = findings.suggestion.columns.get("time", {})
        same = guess.get("column") == time.get("column")
        return same and findings.state("columns", time={**time, **guess})
    if error.parameter.endswith(".unit"):
        findings.asked = "these units"
        return False
    return _guess(findings)


def _guess(findings: Findings) -> bool:
    """State the layout that the text seems to have, and return whether it is another one."""
    guess, usual = findings.suggestion, vars(Dialect())
    if not guess.titles:
        return False
    columns = {key: guess.columns.get(key, usual[key]) for key in _DIALECT}
    stated = findings.tree["columns"]
    columns = {key: v for key, v in columns.items() if v != stated.get(key, usual[key])}
    changed = bool(columns) and findings.state("columns", **columns)
    file, section = guess.file, findings.tree.get("file", {})
    if section.get("names"):
        file = {k: v for k, v in file.items() if k in ("skip", "comment", "tail", "missing_values")}
    texts = [*section.get("missing_values", []), *file.get("missing_values", [])]
    if texts:
        file = {**file, "missing_values": list(dict.fromkeys(texts))}
    return bool(file and findings.state("file", **file)) or changed


def _read(findings: Findings, made: Estimation, data: Path) -> tuple[bool, list[Array], list[int]]:
    """The cells of all rows and their lines, and whether they are to be read by other keys."""
    file = File(data, Dialect.of(made.specification))
    layout = made.layout
    if file.columnar:
        return False, list(file.blocks(layout.titles, layout.clock, made.report)), []
    head = file.head()
    rows = file.rows(head, layout.titles, layout.clock, made.report)
    for why, count in head.left_out.items():
        made.report.count(made.report.left_out, why, count)
    blocks, numbers, lines = list[Array](), list[list[float]](), list[int]()
    again, stuck, odd, tail = False, False, list[int](), made.specification.file.tail == "drop"
    with file.located():
        texts = (line for _, text in file.texts(head.lines, BLOCK) for line in lines_of(text))
        for line, last in _with_last(texts, made.specification):
            try:
                cells = _cells(rows, line)
            except InputError as error:
                if not (last and tail):
                    again = _refuse_line(findings, rows, line, error) or again
                    odd.append(rows.line)
                continue
            if cells is None:
                continue
            values, unread, other = _values(findings, rows, cells, last and tail)
            again, stuck = again or other, stuck or unread
            if values:
                numbers.append(values)
                lines.append(rows.line)
            if len(numbers) == _ROWS:
                blocks.append(np.array(numbers))
                numbers = []
    if odd and not again:
        alone = odd == [rows.line]
        many = len(odd) > len(lines)
        again = findings.state("file", tail="drop") if alone else many and _guess(findings)
    findings.final = findings.final or (not again and (stuck or bool(odd)))
    return again, blocks + ([np.array(numbers)] if numbers else []), lines


def _with_last(lines: Iterator[str], specification: Specification) -> Iterator[tuple[str, bool]]:
    """Lines, and whether each is the last one that is not left out."""
    dialect, waiting = Dialect.of(specification), list[str]()
    for line in lines:
        if waiting and not (dialect.is_empty(line) or dialect.is_comment(line)):
            yield from ((text, False) for text in waiting)
            waiting = []
        waiting.append(line)
    yield from ((text, k == 0) for k, text in enumerate(waiting))


def _cells(rows: TextRows, line: str) -> list[str] | None:
    """The cells of a line, None if it is no row (raises as `TextRows.cells`)."""
    row = rows.row(line)
    cells = None if row is None else rows.cells(row)
    if rows.held is not None:
        error, rows.held = rows.held, None
        raise error
    return cells


def _values(
    findings: Findings, rows: TextRows, cells: list[str], dropped: bool
) -> tuple[list[float], bool, bool]:
    """The numbers of a row, whether one is refused, and whether a key reads it.

    There are none without a time. It may be ``dropped`` if a cell is refused.
    """
    values, again, unread, timed = list[float](), False, False, True
    for column in range(len(rows.titles)):
        try:
            value = rows.number(column, cells)
            if np.isinf(value):
                raise rows.refusal(column, cells, ValueError())
        except InputError as error:
            if dropped:
                return [], False, False
            again = _refuse_cell(findings, rows, column, cells, error) or again
            unread = True
            value, timed = np.nan, timed and not (column == 0 and rows.clock is not None)
        values.append(value)
    return values if timed else [], unread, again


def _refuse_line(findings: Findings, rows: TextRows, line: str, error: InputError) -> bool:
    """Take a line with another number of cells, and return whether a key reads on."""
    findings.refuse(error, "cells", rows.line)
    sign = sign_of(line)
    if rows.ended and sign and not findings.tree.get("file", {}).get("comment"):
        return findings.state("file", comment=sign)
    return not rows.ended and findings.state("file", tail="drop")


def _refuse_cell(
    findings: Findings, rows: TextRows, column: int, cells: list[str], error: InputError
) -> bool:
    """Take a cell that is no number, and return whether a key reads on."""
    timed = column == 0 and rows.clock is not None
    at = rows.clocks if timed else [rows.places[column]]
    cell = next(filter(None, (bare(cells[k]) for k in at)), "")
    findings.refuse(error, f"{column} {cell}" if not cell[:1].isdigit() else f"{column}", rows.line)
    section = findings.tree.get("file", {})
    if rows.repeats:
        return findings.state("file", repeated_header="skip")
    if not rows.ended:
        return findings.state("file", tail="drop")
    first = rows.is_first and not any(text.strip()[:1].isdigit() for text in cells)
    if first and "below_header" not in section and not section.get("names"):
        kind = kind_of_line([text.strip() for text in cells])
        return findings.state("file", below_header=[kind])
    if (cell[:1].isdigit() or timed) and _guess_marks(findings, rows, column):
        return True
    if timed and HOUR.fullmatch(cell):
        findings.asked = "columns.time.format and columns.time.day"
    return not timed and findings.state_missing(cell)


def _guess_marks(findings: Findings, rows: TextRows, column: int) -> bool:
    """State the marks, and the way dates are written, that the text seems to have."""
    guess = findings.suggestion
    keys = {key: guess.columns[key] for key in _DIALECT if key in guess.columns}
    time, stated = guess.columns.get("time", {}), findings.tree["columns"].get("time", {})
    if column == 0 and rows.clock is not None and time.get("column") == stated.get("column"):
        keys["time"] = {k: v for k, v in {**stated, **time}.items() if k in time or k == "zone"}
    return bool(keys) and findings.state("columns", **keys)
