"""Golden tables: what is within rounding is quiet, and any other cell is named, old and new."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from reobserve.errors import InputError
from reobserve.evidence.golden import kept, tables
from reobserve.evidence.golden.files import Golden
from reobserve.evidence.golden.kept import table_cells
from reobserve.evidence.golden.tolerances import Tolerance
from reobserve.plain_data.files import write_table

HEADER = ("term", "printed", "computed")
GOLDEN = (("x1", 2.5, 2.0), ("x1 x2", None, 3e6), ("x2^2", "-", 0.0))


def cells(*rows: tuple[Any, ...]) -> tuple[dict[str, str], ...]:
    return table_cells("ilo", [dict(zip(HEADER, row, strict=True)) for row in rows])


@pytest.fixture
def kept_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    module = SimpleNamespace(HEADER=HEADER, KINDS={})
    for reader in (kept, tables):
        monkeypatch.setattr(reader, "paper_module", lambda paper, stage: module)
    rows = cells(*GOLDEN)
    assert tables.numeric_columns(rows) == ["computed"]
    columns = {"computed": Golden(tuple(row["computed"] for row in rows), "", Tolerance(2e-3))}
    tables.write_rows(tmp_path, "ilo", "table1", rows, columns)
    return tmp_path


def table_deviations(kept: Path, *rows: tuple[Any, ...]) -> list[str]:
    return list(map(str, tables.compare_rows(cells(*rows), "ilo", "table1", kept)))


def test_a_table_within_rounding_is_golden(kept_table: Path) -> None:
    assert (kept_table / "table1.csv").read_text() == (
        "term,printed,computed\nx1,2.5,2.0\nx1 x2,,3000000.0\nx2^2,-,0.0\n"
    )
    assert table_deviations(kept_table, *GOLDEN) == []
    close = (("x1", 2.5, 2 + 1e-9), ("x1 x2", None, 3e6 + 1.9e-3), ("x2^2", "-", -1.9e-3))
    assert table_deviations(kept_table, *close) == []


@pytest.mark.parametrize(
    ("row", "cells", "said"),
    [
        (0, ("x1", 2.5, 2.003), "computed in row 1: golden 2, found 2.003, off by 0.003"),
        (1, ("x1 x2", None, 3e6 + 4e-3), "computed in row 2: golden 3000000, found 3000000"),
        (2, ("x2^2", "-", 0.0021), "computed in row 3: golden 0, found 0.0021"),
        (2, ("x2^2", "-", float("nan")), "computed in row 3: golden 0, found nan"),
        (2, ("x2^2", "-", None), "computed in row 3: golden '0.0', found ''"),
        (0, ("x2", 2.5, 2.0), "term in row 1: golden 'x1', found 'x2'"),
        (1, ("x1 x2", 0.0, 3e6), "printed in row 2: golden '', found '0.0'"),
        # One word in a column makes all of it text: equal means the same letters.
        (0, ("x1", 2.5 + 1e-12, 2.0), "printed in row 1: golden '2.5', found '2.500000000001'"),
    ],
)
def test_a_moved_cell_is_noticed(
    kept_table: Path, row: int, cells: tuple[Any, ...], said: str
) -> None:
    (found,) = table_deviations(kept_table, *GOLDEN[:row], cells, *GOLDEN[row + 1 :])
    assert found.startswith(f"ilo table1, {said}")


def test_a_lost_row_and_a_damaged_golden_table_are_noticed(kept_table: Path) -> None:
    (found,) = table_deviations(kept_table, *GOLDEN[1:])
    assert found.startswith("ilo table1, rows: golden 3, found 2")
    path = kept_table / "table1.csv"
    write_table(path, [], HEADER[:2])
    with pytest.raises(InputError, match="has the columns"):
        table_deviations(kept_table, *GOLDEN)
    path.unlink()
    with pytest.raises(InputError, match=r"table1\.csv: cannot be read"):
        table_deviations(kept_table, *GOLDEN)
