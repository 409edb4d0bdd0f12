"""The table of methods shows the numbers of the results."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from reobserve.core.errors import InputError
from reobserve.core.files import write_table
from reobserve.tuning.results import CELLS, read_cells, summary
from reobserve.tuning.tuned_file import TunedMethod

from .toy import stated_results


def test_table_lists_requirements_and_cost_of_each_method(tmp_path: Path) -> None:
    results = stated_results(tmp_path)
    lines = summary(results).splitlines()
    assert lines[4] == (
        "| Share | k | g | 1 | 25 | 0.250 [0.100 0.300] | **0.750** [0.100 0.300] | 12 ms | 0.50 "
        "| 0.25 µs, 1.5 ms | share (high) |"
    )
    assert "| Share, the paper's settings | – | – | – | – | 2.50 [0.100 0.300], 25 % f" in lines[5]
    assert "**0.450** [0.100 0.300]" in lines[7]
    assert "| lag | 95 % | cost |" in lines[2]
    assert "||" not in " ".join(line.replace(" ", "") for line in lines)
    results.cells[0]["nees"] = 1.234  # type: ignore[index]
    head, _, first, second, *_, note = summary(results).splitlines()[2:]
    assert "| 95 % | NEES | cost |" in head
    assert "| 0.50 | 1.23 |" in first
    assert "| 0.50 | – |" in second
    assert "NEES: mean of (estimate - truth)^2 over its variance" in note
    assert "Bold: within 5 % of the best row in the column; ?: undecided; neither: not." in note
    assert "| 0.200? [0.100 0.300] |" in lines[6]
    assert "missed" not in note
    results.cells[0]["missed"] = 0.25  # type: ignore[index]
    results.task.module.NOTE = "What a cell is."  # type: ignore[attr-defined]
    head, _, first, *_, note = summary(results).splitlines()[2:]
    assert "| 95 % | missed | NEES | cost |" in head
    assert "| 0.50 | 25 % | 1.23 |" in first
    assert "| 0.250 [0.100 0.300], 25 % missed |" in first
    assert "missed: share of records without an alarm in time. NEES: " in note
    assert "What a cell is." in note
    results.task.module.COLUMNS = ("delay", "false alarms")  # type: ignore[attr-defined]
    head = summary(results).splitlines()[2]
    assert "| delay | false alarms | missed | NEES | cost |" in head


@pytest.mark.parametrize(
    ("column", "cell", "said"),
    [
        ("error", "0.0.1", "must be a number, nan, inf or empty"),
        ("lag", "1e", "must be a number, nan, inf or empty"),
        ("repeat_low", "1,5", "must be a number, nan, inf or empty"),
        ("given_noise", "perhaps", "must be yes or no"),
        ("within", "", "must be yes, no, undecided or late"),
        ("method", " ", "must be a name"),
    ],
)
def test_damaged_cell_is_refused_by_its_column(
    tmp_path: Path, column: str, cell: str, said: str
) -> None:
    words = {"condition": "a", "method": "b", "training": "c", "given_noise": "no", "within": "yes"}
    row = dict.fromkeys(CELLS, "") | {"error": "inf", "low": "nan", "seeds": 3} | words
    write_table(tmp_path / "t.csv", [row], CELLS)
    (found,) = read_cells(tmp_path / "t.csv")
    assert (found["error"], found["seeds"], found["method"]) == (float("inf"), 3.0, "b")
    write_table(tmp_path / "t.csv", [row | {column: cell}], CELLS)
    with pytest.raises(InputError, match=rf"t\.csv: line 2, {column}: .* {said}"):
        read_cells(tmp_path / "t.csv")


@pytest.mark.parametrize(
    "keys", [["10;"], ["ten"], ["1.5"], ["0", "10"], ["20", "10"], ["10", "010"], []]
)
def test_tuned_file_with_other_numbers_of_evaluations_is_refused(
    tmp_path: Path, keys: list[str]
) -> None:
    path = tmp_path / "k.json"

    def read(keys: list[str]) -> TunedMethod:
        held_out = dict.fromkeys(keys, 0.5)
        repeat = {"settings": {}, "objective": 1.0, "edges": {}, "held_out": held_out}
        training = {"main": {"digest": "d", "repeats": [repeat]}}
        cost = {"construction": 1.0, "sample": 1.0}
        path.write_text(json.dumps({"training": training, "cost": cost}))
        return TunedMethod.read(path)

    assert read(["10", "25"]).training["main"].repeats[0].error == 0.5
    with pytest.raises(InputError, match=r"k\.json\.training\.main\.repeats\.0\.held_out: "):
        read(keys)
