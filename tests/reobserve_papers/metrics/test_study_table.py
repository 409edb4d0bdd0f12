"""Study tables: text is converted to numbers, and rows are found by their coordinates."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from reobserve.core.files import GAP, NAME, NUMBER, SCORE, WHOLE
from reobserve_papers.metrics.study_table import StudyTable

KINDS = {"form": NAME, "order": WHOLE, "x": GAP, "level": NUMBER, "value": SCORE}
ROWS: list[dict[str, Any]] = [
    {"form": "b", "order": 4, "x": "", "level": 0.1, "value": 1.5},
    {"form": "a", "order": 2, "x": 0.0, "level": 0.1, "value": float("nan")},
    {"form": "b", "order": 2, "x": -1.0, "level": 3.0, "value": 2.5},
    {"form": "b", "order": 4, "x": "", "level": 3.0, "value": 3.5},
]
TEXT = [{name: str(cell) for name, cell in row.items()} for row in ROWS]


@pytest.mark.parametrize("rows", [ROWS, TEXT])
def test_cells_are_converted_by_column_type(rows: list[dict[str, Any]]) -> None:
    table = StudyTable.of(rows, KINDS)
    assert len(table) == 4
    assert table["form"].tolist() == ["b", "a", "b", "b"]
    assert table["order"].dtype.kind == "i"
    np.testing.assert_array_equal(table["x"], [np.nan, 0.0, -1.0, np.nan])
    np.testing.assert_array_equal(table["value"], [1.5, np.nan, 2.5, 3.5])


def test_rows_are_found_by_their_coordinates() -> None:
    table = StudyTable.of(TEXT, KINDS)
    assert table.where(form="b", order=4)["value"].tolist() == [1.5, 3.5]
    assert len(table.where(form="c")) == 0
    assert table.value(form="b", order=2) == 2.5
    assert table.value("order", form="a") == 2.0
    with pytest.raises(LookupError, match=r"^2 rows with form 'b', order 4$"):
        table.value(form="b", order=4)
    with pytest.raises(LookupError, match=r"^0 rows with form 'c'$"):
        table.value(form="c")
    with pytest.raises(LookupError):
        table.where(frm="b")


def test_groups_follow_row_order_and_curves_follow_levels() -> None:
    table = StudyTable.of(TEXT[::-1], KINDS)
    groups = {key: rows["level"].tolist() for key, rows in table.groups("form", "order")}
    assert groups == {("b", 4): [3.0, 0.1], ("b", 2): [3.0], ("a", 2): [0.1]}
    assert list(groups) == [("b", 4), ("b", 2), ("a", 2)]
    assert table.levels("order") == [4, 2]
    curve = table.where(form="b").by_level("level")
    assert {level: values.tolist() for level, values in curve.items()} == {
        0.1: [1.5], 3.0: [3.5, 2.5],
    }  # fmt: skip
    assert list(curve) == [0.1, 3.0]


def test_missing_study_is_an_empty_table() -> None:
    assert not StudyTable()
    assert not StudyTable.of([], KINDS)
    assert StudyTable.of([], KINDS)["value"].tolist() == []
