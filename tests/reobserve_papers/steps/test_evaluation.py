"""Evaluations: parts of papers, and results of a build that need not be computed again."""

from __future__ import annotations

from pathlib import Path

import pytest

from reobserve.core.errors import InputError
from reobserve.core.files import write_table
from reobserve_papers.steps.compute import paper_module
from reobserve_papers.steps.evaluation import Evaluator
from tests.reobserve_papers.pipeline.conftest import EVALUATORS, PARAMETER_FILES


@pytest.fixture(scope="module")
def study_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    evaluator = EVALUATORS["ilo"]
    rows = evaluator.result("study", "matching")
    path = tmp_path_factory.mktemp("built") / "matching.study.csv"
    write_table(path, rows, paper_module("reobserve_papers.papers.ilo", "study_rows").HEADER)
    return path


def test_stored_studies_give_the_same_numbers(
    study_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("the study is run again")

    after = Evaluator(PARAMETER_FILES["ilo"])
    after.take_study("matching", study_file)
    monkeypatch.setattr(paper_module("reobserve_papers.papers.ilo", "study"), "run", refuse)
    found, wanted = (one.figure("fig4_matched").numbers for one in (after, EVALUATORS["ilo"]))
    assert repr(found) == repr(wanted)  # compares nan with nan as equal
    # With other values the stored study does not apply.
    tree = {**PARAMETER_FILES["ilo"].tree, "plant": {**PARAMETER_FILES["ilo"].tree["plant"]}}
    tree["plant"]["horizon"] = {**tree["plant"]["horizon"], "value": 11.0}
    with pytest.raises(AssertionError, match="run again"):
        after.sibling(
            type(PARAMETER_FILES["ilo"])("ilo", tree, PARAMETER_FILES["ilo"].seed)
        ).figure("fig4_matched")


def test_missing_rows_are_reported_with_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_table(
        Path("orders.study.csv"),
        [],
        paper_module("reobserve_papers.papers.lie", "study_rows").HEADER,
    )
    evaluator = Evaluator(PARAMETER_FILES["lie"])
    evaluator.take_study("orders", Path("orders.study.csv"))
    for each in (evaluator, evaluator.isolated(), evaluator.sibling(PARAMETER_FILES["lie"])):
        with pytest.raises(InputError, match=r"^orders\.study\.csv: has not the rows that the fig"):
            each.figure("fig1_orders")


def test_unknown_paper_and_part_are_reported() -> None:
    problem = r"^reobserve_papers\.papers\.nobody: there is no such package$"
    with pytest.raises(InputError, match=problem):
        paper_module("reobserve_papers.papers.nobody", "plant")
    with pytest.raises(InputError, match=r"^reobserve_papers\.papers\.ilo: has no table$"):
        paper_module("reobserve_papers.papers.ilo", "table")
