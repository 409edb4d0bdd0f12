"""The table of methods shows the numbers of the results."""

from __future__ import annotations

from pathlib import Path

from reobserve.tuning.table import summary

from .toy import stated_results


def test_table_lists_requirements_and_cost_of_each_method(tmp_path: Path) -> None:
    results = stated_results(tmp_path)
    lines = summary(results).splitlines()
    assert lines[4] == (
        "| Share | k | g | 1 | 25 | 0.250 [0.100 0.300] | **0.750** [0.100 0.300] | 12 ms | 0.50 "
        "| 0.25 µs, 1.5 ms | share (high) |"
    )
    assert "| Share, the paper's settings |  |  |  |  | 2.50 [0.100 0.300], 25 % f" in lines[5]
    assert "**0.450** [0.100 0.300]" in lines[7]
    assert "| lag | 95 % | cost |" in lines[2]
    results.task.module.COLUMNS = ("delay", "false alarms")  # type: ignore[attr-defined]
    head = summary(results).splitlines()[2]
    assert "| delay | false alarms | cost |" in head
