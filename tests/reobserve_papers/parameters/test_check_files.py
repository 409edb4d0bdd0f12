"""`reobserve-papers check` reports any error under ``config/`` before the first job."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from reobserve.core.errors import InputError
from reobserve_papers.cli.main import main
from reobserve_papers.cli.stages.check import run
from reobserve_papers.parameters.config import known_papers
from tests import ROOT

# By name: a file, a replacement in it, and the beginning of the message.
FAULTS = {
    "a key of a claim": (
        "claims/ilo.yaml", "threshold: after", "treshold: after",
        "claims.ilo.learning_is_no_integrator.treshold: unknown key; did you mean 'threshold'?",
    ),
    "a metric": (
        "claims/ilo.yaml", "distance_from_integrator", "distance_from_integrators",
        "claims.ilo.learning_is_no_integrator.checks.0.value.metric: there is no 'distance_from_in",
    ),
    "a parameter": (
        "claims/ilo.yaml", "- observers.sampled.K1\n", "- observers.sampled.K3\n",
        "claims.ilo.choices.learning.depends_on: there is no 'observers.sampled.K3'; did",
    ),
    "a relation": (
        "claims/ilo.yaml", "above: 0.05", "over: 0.05",
        "claims.ilo.learning_is_no_integrator.checks.0.over: 0.05 must be a",
    ),
    "the certainty of an erratum": (
        "errata/ilo.yaml", "certainty: certain", "certainty: sure",
        "errata.ilo.",
    ),
    "a figure of ours beside the paper's": (
        "claims/ilo.yaml", "ours: [fig1", "ours: [fig0",
        "claims.ilo.figures.Fig. 1.ours: there is no 'fig0'; did you mean 'fig",
    ),
    "a number beside a printed one": (
        "claims/imm.yaml", 'text: "85 %", value: fig5 ', 'text: "85 %", value: fig0 ',
        "claims.imm.figures.Fig. 5.printed.0.value.figure: there is no 'fig0'; did you mean",
    ),
    "a figure that is shown and not": (
        "claims/ilo.yaml", "    ours: [fig1", "    not_reproduced: a drawing\n    ours: [fig1",
        "claims.ilo.figures.Fig. 1: must have ours or not_reproduced, and not both",
    ),
    "the erratum of a claim": (
        "claims/ilo.yaml", "errata: [norm_of_k_d]", "errata: [norm_of_k]",
        "claims.ilo.theorem_1_true.errata: there is no 'norm_of_k'; did you mean 'norm_of_k_d'?",
    ),
    "samples": ("samples/ilo.json", '"basis": "', '"basis": 1, "more": "', ""),
    "a search": ("searches/imm_calibrated.json", "{", "[", "imm.studies.neighbourhood.kept."),
    "a value off its grid": (
        "papers/ilo.yaml", "value: 10.0\n    unit: s", "value: 10.4\n    unit: s",
        "ilo.plant.horizon: 10.4 must be a multiple of 1",
    ),
    "a link": (
        "papers/ilo.yaml", "same_as: plant.initial_rate", "same_as: plant.rate",
        "ilo.observers.sampled.initial_rate.same_as: there is no entry 'plant.rate'",
    ),
    "an entry that others link to": (
        "papers/ilo.yaml", "unit: rad/s\n    source: assumed", "unit: rad/s\n    origin: assumed",
        "ilo.plant.initial_rate.origin: unknown key",
    ),
}  # fmt: skip


@pytest.fixture
def project(tmp_path: Path) -> Path:
    shutil.copytree(ROOT / "config", tmp_path / "config")
    return tmp_path


@pytest.mark.parametrize("case", FAULTS)
def test_error_in_config_is_reported_before_the_first_job(project: Path, case: str) -> None:
    file, old, new, said = FAULTS[case]
    path = project / "config" / file
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        run(project, ["ilo", "imm"], {})
    assert str(caught.value).startswith(said or str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.nightly_after(1)
@pytest.mark.parametrize("first", ["claims/ilo.yaml", "papers/ilo.yaml", "errata/ilo.yaml"])
def test_errors_of_all_papers_are_reported(
    project: Path, first: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for file in (first, "claims/imm.yaml", "styles/slides.mplstyle"):
        (project / "config" / file).write_text("nonsense: 1\n", encoding="utf-8")
    assert main(["check", "--project", str(project)]) == 1
    lines = capsys.readouterr().err.splitlines()
    errors = [line for line in lines if line.startswith("reobserve-papers: ")]
    assert len(errors) == 3
    assert ["ilo" in errors[0], "imm" in errors[1], "slides" in errors[2]] == [True] * 3
    assert sum(line.endswith("are sound") for line in lines) == len(known_papers(project)) - 2


def test_damaged_style_sheet_is_named(project: Path) -> None:
    path = project / "config/styles/slides.mplstyle"
    path.write_text("font.siez: 3\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"slides\.mplstyle"):
        run(project, [], {})


def test_config_of_the_project_is_valid(capsys: pytest.CaptureFixture[str]) -> None:
    run(ROOT, [], {})
    assert capsys.readouterr().err.count("are sound\n") == 5
