"""Golden tables: each table of a paper as it was, compared cell by cell."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from reobserve.evidence.golden.deviation import Deviation, OtherCell
from reobserve.evidence.golden.files import Golden, as_number, read_tolerances, write_tolerances
from reobserve.plain_data.files import read_table, write_table
from reobserve.replication.steps import paper_module


def compare_rows(
    rows: Sequence[Mapping[str, str]], paper: str, table: str, golden: Path
) -> Iterator[Deviation | OtherCell]:
    """The cells of a table that are not the golden ones, in the folder ``golden``.

    Raises
    ------
    InputError
        If the golden table is missing, damaged or has other columns.
    """
    return (one for one in differences(rows, paper, table, golden) if one.exceeds)


def differences(
    rows: Sequence[Mapping[str, str]], paper: str, table: str, golden: Path
) -> Iterator[Deviation | OtherCell]:
    """Every number of a table with its golden one, and other cells that differ; as `compare_rows`.

    A column with a word in it is text as a whole: equal means the same letters.
    """
    name = f"{paper} {table}"
    kept = read_rows(golden, paper, table)
    tolerances = read_tolerances(golden, table)
    if len(rows) != len(kept):
        yield Deviation(name, "rows", len(kept), len(rows), 0.0)
        return
    for line, (before, now) in enumerate(zip(kept, rows, strict=True), start=1):
        for column, old in before.items():
            new, what = now[column], f"{column} in row {line}"
            if column in tolerances and is_number(old) and is_number(new):
                allowed = tolerances[column][1].allowed
                yield Deviation(name, what, float(old), float(new), allowed, column)
            elif old != new:
                yield OtherCell(name, what, old, new)


def read_rows(golden: Path, paper: str, table: str) -> list[dict[str, str]]:
    """The cells of the golden table; raises as `compare_rows`."""
    return read_cells(golden / f"{table}.csv", paper)


def read_cells(path: Path, paper: str) -> list[dict[str, str]]:
    """The cells of a paper's table; `InputError` if it has other columns, or cells of no sense."""
    module = paper_module(paper, "table")
    return read_table(path, module.HEADER, module.KINDS)


def write_rows(
    golden: Path,
    paper: str,
    table: str,
    rows: Sequence[Mapping[str, str]],
    columns: Mapping[str, Golden],
) -> None:
    """Write the golden table, as the stage writes it, and the tolerances of its ``columns``."""
    write_table(golden / f"{table}.csv", rows, table_header(paper))
    write_tolerances(golden, table, columns)


def numeric_columns(rows: Sequence[Mapping[str, str]]) -> list[str]:
    """The columns that hold numbers, or nothing, and a number at least."""
    names = rows[0] if rows else {}
    cells = {name: [row[name] for row in rows if row[name]] for name in names}
    return [name for name, texts in cells.items() if texts and all(map(is_number, texts))]


def is_number(text: str) -> bool:
    """Whether a cell holds a number, nan among them."""
    return text.strip().lower() == "nan" or not math.isnan(as_number(text))


def table_header(paper: str) -> Sequence[str]:
    """The columns of the tables of a paper."""
    header: Sequence[str] = paper_module(paper, "table").HEADER
    return header
