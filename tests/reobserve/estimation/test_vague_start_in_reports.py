"""Warnings of the library of a start that is too vague: in reports of files and of streams."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest

from reobserve.estimation.estimate import Estimation
from reobserve.estimation.estimate_command import estimate_file
from reobserve.estimation.families.examples import simulated
from reobserve.estimation.row_by_row import RowByRow
from reobserve.observers.gaussian_state import VagueStartWarning
from tests.reobserve.estimation.records import specification, write_record

KINDS = ("kalman", "extended-kalman", "unscented-kalman", "augmented-kalman", "fault-bank")


def of_the_start(made: Estimation) -> list[str]:
    return [one for one in made.report.warnings if one.startswith("covariance: ")]


@pytest.mark.nightly_after(5)
@pytest.mark.parametrize(
    ("name", "variance"), [("kalman", 1.0), ("fault-bank", 1.0), *((name, 1e18) for name in KINDS)]
)
def test_report_warns_where_the_library_does(name: str, variance: float, tmp_path: Path) -> None:
    chosen = specification(name, observer={"initial_covariance": variance})
    columns = {title: values[:60] for title, values in simulated(name).record().items()}
    record = write_record(tmp_path / "r.csv", columns)
    made = estimate_file(chosen, record, tmp_path / "e.csv")
    titles, *lines = record.read_text().splitlines(keepends=True)
    stream = Estimation(chosen, titles.strip().split(","), str(record))
    rows = RowByRow(stream, titles.strip().split(","))
    "".join(map(rows.read, lines)) + rows.finish()
    assert of_the_start(stream) == of_the_start(made)

    cells = [
        way.of(values)
        for way, values in zip(made.layout.conversions, columns.values(), strict=True)
    ]
    y, u = cells[1 : 1 + made.layout.measurements], cells[1 + made.layout.measurements :]
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        made.observer.run(list(zip(*y, strict=True)), list(zip(*u, strict=True)) or None,
                          start=made.design.start())  # fmt: skip
    doubts = [one for one in said if one.category is VagueStartWarning]
    assert len(of_the_start(made)) == len(doubts)
    if variance == 1e18:
        assert doubts
        assert " at 0 s," in of_the_start(made)[0]


@pytest.mark.parametrize("name", KINDS[:4])
def test_report_of_smoothed_estimates_warns(name: str, tmp_path: Path) -> None:
    chosen = specification(name, observer={"initial_covariance": 1e10}, smooth=True)
    columns = {title: values[:60] for title, values in simulated(name).record().items()}
    made = estimate_file(chosen, write_record(tmp_path / "r.csv", columns), tmp_path / "e.csv")
    assert of_the_start(made)
