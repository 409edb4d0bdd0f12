"""Golden tables: each table of a paper as it was, compared cell by cell."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reobserve.evaluation import Evaluator
from reobserve.files import cell, read_table, write_table
from reobserve.golden import Deviation
from reobserve.stages.common import paper_module

# A number may move by this part of itself, or of one if it is smaller: what processors round
# differently. A design is computed without steps, so there is none to halve.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class OtherCell:
    """A cell that is not what the golden table holds."""

    table: str
    what: str
    golden: str
    found: str

    def __str__(self) -> str:
        """One line: where, what it was, what it is."""
        return f"{self.table}, {self.what}: golden {self.golden!r}, found {self.found!r}"


def compare(evaluator: Evaluator, table: str, golden: Path) -> Iterator[Deviation | OtherCell]:
    """The deviations of a table from the golden one in the folder ``golden``.

    Raises
    ------
    InputError
        If the golden table is missing, damaged or has other columns.
    """
    yield from compare_rows(evaluator.table(table), evaluator.ledger.paper, table, golden)


def compare_rows(
    rows: Sequence[Mapping[str, Any]], paper: str, table: str, golden: Path
) -> Iterator[Deviation | OtherCell]:
    """The deviations of a table's rows, computed or read from its file; raises as `compare`."""
    name = f"{paper} {table}"
    header = table_header(paper)
    kept = read_rows(golden / f"{table}.csv", paper)
    if len(rows) != len(kept):
        yield Deviation(name, "rows", len(kept), len(rows), 0)
        return
    for column in header:
        before = [row[column] for row in kept]
        now = [cell(row.get(column)) for row in rows]
        numeric = all(_number(text) is not None for text in before if text)
        for line, (old, new) in enumerate(zip(before, now, strict=True), start=1):
            if old != new:
                yield from _difference(name, f"{column} in row {line}", old, new, numeric)


def write(evaluator: Evaluator, table: str, golden: Path) -> None:
    """Write the golden table, the same file that the stage writes."""
    header = table_header(evaluator.ledger.paper)
    write_table(golden / f"{table}.csv", evaluator.table(table), header)


def read_rows(path: Path, paper: str) -> list[dict[str, str]]:
    """The rows of a paper's table; `InputError` if it has other columns, or cells of no sense."""
    module = paper_module(paper, "table")
    return read_table(path, module.HEADER, module.KINDS)


def table_header(paper: str) -> Sequence[str]:
    """The columns of the tables of a paper."""
    header: Sequence[str] = paper_module(paper, "table").HEADER
    return header


def _difference(
    name: str, what: str, old: str, new: str, numeric: bool
) -> Iterator[Deviation | OtherCell]:
    golden, found = _number(old), _number(new)
    if not numeric or golden is None or found is None:
        yield OtherCell(name, what, old, new)
        return
    tolerance = _ROUNDING * max(1.0, abs(golden))
    # Not so for nan; and what is infinite must be equal as text.
    if not (abs(found - golden) <= tolerance < math.inf):
        yield Deviation(name, what, golden, found, tolerance)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
