"""Targets of a build that no rule makes: one sentence, with the nearest that there is."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from reobserve_papers.cli.options import FORMATS
from reobserve_papers.cli.targets import check_targets
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.chain import all_outputs
from tests import ROOT

PAPERS = {paper: Parameters.load(ROOT, paper) for paper in known_papers(ROOT)}
RESULTS = [path for one in PAPERS.values() for path in all_outputs(one, FORMATS)]
BUILT = {path for path in RESULTS if not path.endswith((".eps", ".pgf"))}
RULE = SimpleNamespace(
    name="figures", output=["results/report.html"], has_wildcards=lambda: False,
    is_producer=lambda target: target in {*BUILT, "results/report.html"},
)  # fmt: skip
OF_USER = SimpleNamespace(
    name="mine", output=[], has_wildcards=lambda: True,
    is_producer=lambda target: target.startswith("results/ilo/mine"),
)  # fmt: skip


def checked(*targets: str, **asked: list[str]) -> None:
    """Check targets as Snakemake does, with a rule that a user adds."""
    settings: Any = dict.fromkeys(("targets", "forcerun", "until", "omit_from"), ())
    workflow: Any = SimpleNamespace(
        rules=[RULE], is_main_process=True, is_rule={"figures", "mine"}.__contains__,
        dag_settings=SimpleNamespace(**{**settings, "targets": targets, **asked}),
        _prepare_dag=lambda: None,
    )  # fmt: skip
    check_targets(workflow, lambda: RESULTS)
    workflow.rules.append(OF_USER)
    workflow._prepare_dag()


def refused(*targets: str, **asked: list[str]) -> str:
    with pytest.raises(SystemExit) as caught:
        checked(*targets, **asked)
    return str(caught.value)


KINDS = {path.rpartition("/")[2].partition(".")[2]: path for path in sorted(BUILT)}


def test_what_rules_make_is_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    tables = [path for path in sorted(BUILT) if path.endswith((".csv", ".rst"))]
    of_tables = [f"{path[:-4]}.tex" for path in tables]
    checked("figures", "mine", "results/ilo/mine.txt", *sorted(BUILT), *of_tables)
    checked("./results/ilo/fig1.pdf", "results/ilo/../ilo/fig1.pdf", until=["mine"])


@given(st.data())
@example(None)
def test_letter_changed_in_a_target_names_the_near_one(data: st.DataObject | None) -> None:
    path, at, letter = "results/ilo/constant/plant.parquet", 17, "X"
    if data:
        path = data.draw(st.sampled_from(sorted(KINDS.values())) | st.sampled_from(sorted(BUILT)))
        at = data.draw(st.integers(len("results/"), len(path) - 1).filter(lambda k: path[k] != "/"))
        letter = data.draw(st.sampled_from("XQ"))
    wrong = f"{path[:at]}{letter}{path[at + 1 :]}"
    said = refused(wrong)
    part = wrong.count("/", 0, at)
    start = f"reobserve-papers: {wrong}: there is no {wrong.split('/')[part]!r}; "
    assert said.startswith(start)
    near = said.removeprefix(start)
    there = {
        one.split("/")[part] for one in RESULTS if one.split("/")[:part] == path.split("/")[:part]
    }
    if near.startswith("did you mean"):
        assert near.split("'")[1] in {*there, "report.html"}
    else:  # a word of few letters, such as a paper
        assert part == 1
        assert all(paper in near for paper in PAPERS)


@pytest.mark.parametrize("kind", ["eps", "pgf"])
@pytest.mark.parametrize("paper", PAPERS)
def test_format_that_is_not_built_is_offered(paper: str, kind: str) -> None:
    for figure in PAPERS[paper].tree["figures"]:
        path = f"results/{paper}/{figure}.{kind}"
        assert refused(path) == (
            f"reobserve-papers: {path}: the format {kind} is not built; ask for it by --config "
            f"'formats=[{kind}]'"
        )


def test_other_targets_that_nothing_makes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert (
        refused("figurs")
        == "reobserve-papers: figurs: there is no 'figurs'; did you mean 'figures'?"
    )
    assert "figurs'; did you mean 'figures'?" in refused(until=["figurs"])
    assert "figurs'; did you mean 'figures'?" in refused("figures", forcerun=["figurs"])
    assert "did you mean 'report.html'?" in refused("results/reprot.html")
    assert all(paper in refused("results/nobody/fig1.pdf") for paper in PAPERS)
    assert "did you mean 'fig" in refused("results/ilo/fig99.pdf")
    assert "did you mean 'fig" in refused("results/ilo/fig99.eps")
    assert "results/ilo: is a folder, must be a file in it, such as" in refused("results/ilo")
    path = str(tmp_path / "results/ilo/fig1.pdf")
    assert refused(path).endswith("must be a path from this folder, as results/ilo/fig1.pdf")
    assert "fig9.metrics.csv'; did you mean" in refused("results/ilo/fig9.metrics.tex")
