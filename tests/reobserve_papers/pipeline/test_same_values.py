"""The pipeline gives the library's results: one call in this process against jobs and files."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from reobserve.core.files import write_table
from reobserve_papers.metrics.metrics import read_metrics
from reobserve_papers.signals.series import Series
from reobserve_papers.steps.compute import paper_module
from reobserve_papers.steps.evaluation import Evaluator

from .conftest import (
    EVALUATORS,
    FEW_LEVELS,
    FIGURES,
    PAPERS,
    PARAMETER_FILES,
    TABLES,
    Project,
    with_few_levels,
)

# The first figure of each paper by default, the others nightly.
FIRST = {paper: next(iter(PARAMETER_FILES[paper].tree["figures"])) for paper in PAPERS}


@pytest.mark.parametrize(
    ("paper", "figure"),
    [
        pytest.param(paper, figure, marks=() if figure == FIRST[paper] else pytest.mark.nightly)
        for paper, figure in FIGURES
    ],
)
def test_figure_is_bitwise_identical_to_the_library_call(
    as_built: Project, evaluators: dict[str, Evaluator], paper: str, figure: str
) -> None:
    evaluator = evaluators[paper]
    evaluation = evaluator.figure(figure)
    folder = as_built.folder / "results" / paper
    for mine, theirs in zip(
        evaluation.numbers, read_metrics(folder / f"{figure}.metrics.csv"), strict=True
    ):
        assert (mine.observer, mine.metric, mine.unit) == (
            theirs.observer, theirs.metric, theirs.unit,
        )  # fmt: skip
        assert mine.value == theirs.value or (math.isnan(mine.value) and math.isnan(theirs.value))
    scenario = evaluator.parameters.tree["figures"][figure]["scenario"]
    series = {"plant": evaluation.plant, **evaluation.estimates}
    for name, expected in series.items():
        found = Series.read(folder / scenario / f"{name}.parquet")
        assert list(found.channels) == list(expected.channels)
        for channel in found.channels:
            assert np.array_equal(found[channel], expected[channel])
            assert found.channels[channel].unit == expected.channels[channel].unit


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("paper", "study"),
    [
        (paper, study)
        for paper in PAPERS
        for study in PARAMETER_FILES[paper].tree.get("studies", {})
    ],
)
def test_study_is_bitwise_identical_to_the_library_call(
    as_built: Project, tmp_path: Path, paper: str, study: str
) -> None:
    """For the most expensive studies, a few levels, whose rows are among the built ones."""
    parameters = PARAMETER_FILES[paper]
    evaluator = EVALUATORS[paper].sibling(
        with_few_levels(parameters) if study in FEW_LEVELS else parameters
    )
    rows = evaluator.result("study", study)
    write_table(
        tmp_path / "study.csv",
        rows,
        paper_module(PARAMETER_FILES[paper].package, "study_rows").HEADER,
        seal=True,
    )
    built = (as_built.folder / "results" / paper / f"{study}.study.csv").read_bytes()
    mine = (tmp_path / "study.csv").read_bytes()
    if study in FEW_LEVELS:
        assert set(mine.splitlines()[1:]) < set(built.splitlines()[1:])
    else:
        assert mine == built


@pytest.mark.parametrize(("paper", "table"), TABLES)
def test_table_is_bitwise_identical_to_the_library_call(
    as_built: Project, tmp_path: Path, paper: str, table: str
) -> None:
    rows = EVALUATORS[paper].table(table)
    write_table(
        tmp_path / "table.csv",
        rows,
        paper_module(PARAMETER_FILES[paper].package, "table").HEADER,
        seal=True,
    )
    found = as_built.folder / "results" / paper / f"{table}.csv"
    assert found.read_bytes() == (tmp_path / "table.csv").read_bytes()
