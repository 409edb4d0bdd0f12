"""An evaluation after a build: what is read of it is not computed again, and is the same."""

from __future__ import annotations

from pathlib import Path

import pytest

from reobserve.errors import InputError
from reobserve.pipeline.built import evaluator_after
from reobserve.pipeline.common import paper_module
from reobserve.pipeline.evaluation import Evaluator
from reobserve.plain_data.files import write_table

from .conftest import EVALUATORS, LEDGERS


@pytest.fixture(scope="module")
def study_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    evaluator = EVALUATORS["ilo"]
    rows = evaluator._once(evaluator._job("study", study="matching"))
    path = tmp_path_factory.mktemp("built") / "matching.study.csv"
    write_table(path, rows, paper_module("ilo", "study_rows").HEADER)
    return path


def test_studies_are_read_and_give_the_same_numbers(
    study_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise AssertionError("the study is run again")

    after = evaluator_after(LEDGERS["ilo"], [study_file])
    monkeypatch.setattr(Evaluator, "_study", refuse)
    found, wanted = (one.figure("fig4_matched").metrics for one in (after, EVALUATORS["ilo"]))
    assert repr(found) == repr(wanted)  # a nan is itself, then
    # With other values the study that was made is not theirs.
    tree = {**LEDGERS["ilo"].tree, "plant": {**LEDGERS["ilo"].tree["plant"]}}
    tree["plant"]["horizon"] = {**tree["plant"]["horizon"], "value": 11.0}
    with pytest.raises(AssertionError, match="run again"):
        after.sibling(type(LEDGERS["ilo"])("ilo", tree, LEDGERS["ilo"].seed)).figure("fig4_matched")


def test_there_must_be_a_file_for_each_study(study_file: Path) -> None:
    with pytest.raises(
        InputError, match=r"--study-files: 2 must be one for each of \['matching'\]"
    ):
        evaluator_after(LEDGERS["ilo"], [study_file] * 2)
