"""The page on adding an alternative, followed in a copy whose metrics are replaced."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from reobserve.core.files import write_table
from reobserve_papers.claims import outcomes
from reobserve_papers.claims.checks import Reference
from reobserve_papers.claims.configuration_checks import check_evidence
from reobserve_papers.claims.registry import read_registry
from reobserve_papers.claims.sample_command import sample_command
from reobserve_papers.claims.title import NOT_COMPUTED, read_alternatives
from reobserve_papers.cli.stages import alternatives, robustness
from reobserve_papers.metrics.metrics import Metric, write_metrics
from reobserve_papers.parameters.names import samples_path
from reobserve_papers.parameters.parameters import default_parameters
from reobserve_papers.steps.chain import result
from reobserve_papers.steps.compute import paper_module
from reobserve_papers.steps.evaluation import Evaluator
from tests.docs.hand_written import PAGES, ROOT, blocks

PAGE = PAGES / "how-to" / "add-an-alternative.md"
TITLED = {found[1]: block.text for block in blocks(PAGE)
          if (found := re.fullmatch(r'title="(.*)"', block.options))}  # fmt: skip
CLAIM = "periodic_accurate"


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy with `ilo`, of which each metric is a number between 0.02 and 0.05, or a half more."""
    for folder in ("config", "workflow"):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    (tmp_path / samples_path("ilo")).unlink(missing_ok=True)

    listed = wanted(tmp_path)

    def metrics_of(evaluator: Evaluator, figure: str, asked: object = None) -> list[Metric]:
        gain = evaluator.parameters.section("observers")["continuous"]["K2"]
        found = []
        for one in listed:
            if one.figure == figure:
                value = 0.02 + gain / 5000 * 0.03
                worst = 0.5 if "norm=largest window=onset" in one.metric else 0.0
                found.append(Metric(one.observer, one.metric, value + worst, "1"))
        return found

    monkeypatch.setattr(outcomes, "metrics_of", metrics_of)
    return tmp_path


def wanted(project: Path) -> list[Reference]:
    """All numbers that the claims name, and the one of the page, which the code computes, too."""
    claims = read_registry(project, default_parameters(project, "ilo")).claims
    more = Reference("fig2", "learning", "relative_error norm=largest window=onset")
    null = more._replace(observer="mean")
    return list(dict.fromkeys([more, null, *(one for claim in claims for one in claim.wanted)]))


def built(project: Path) -> dict[str, dict[str, str]]:
    """What the jobs `robustness` and `alternatives` find, by alternative, of the claim."""
    folder = project / "results/ilo"
    folder.mkdir(parents=True, exist_ok=True)
    parameters = default_parameters(project, "ilo")
    (folder / "parameters.json").write_text(parameters.text(), encoding="utf-8")
    for figure in (*parameters.tree["figures"], "theory"):
        numbers = outcomes.metrics_of(Evaluator(parameters), figure)
        write_metrics(folder / f"{figure}.metrics.csv", numbers)
    study = result("ilo", "study", "matching")
    write_table(project / study, [], paper_module(parameters.package, "study_rows").HEADER)
    robustness.run(folder / "parameters.json", 40, cached=True)
    alternatives.run(folder / "parameters.json")
    path = project / result("ilo", "alternatives")
    _, rows = read_alternatives(path)
    return {row["alternative"]: row for row in rows if row["claim"] == CLAIM}


def add(project: Path, title: str) -> None:
    with (project / "config/conventions.yaml").open("a", encoding="utf-8") as stream:
        stream.write(TITLED[title])
    check_evidence(project, default_parameters(project, "ilo"))


def test_a_reviewer_adds_an_alternative_in_five_lines(project: Path) -> None:
    assert len(TITLED["bound"].splitlines()) == 5
    before = built(project)
    add(project, "bound")
    after = built(project)
    assert after.keys() - before.keys() == {"largest_error_of_two_per_cent"}
    mine = after["largest_error_of_two_per_cent"]
    assert (mine["verdict"], mine["other"]) == ("reproduced", "contradicted")


def test_another_measure_is_computed_for_the_samples_of_one_claim(project: Path) -> None:
    sample_command(project, ["ilo"], [CLAIM], 40, check=False)
    add(project, "measure")
    mine = built(project)["largest_error_from_the_onset"]
    assert (mine["other"], mine["note"]) == (mine["verdict"], NOT_COMPUTED)
    sample_command(project, ["ilo"], [CLAIM], 40, check=False)
    mine = built(project)["largest_error_from_the_onset"]
    assert (mine["verdict"], mine["other"], mine["note"]) == ("reproduced", "contradicted", "")


def test_page_is_short() -> None:
    assert len(PAGE.read_text(encoding="utf-8").split()) <= 350
