"""`reobserve_papers.replicate`: all stages of a figure in one call."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import reobserve
import reobserve_papers
from reobserve import InputError
from reobserve_papers import replicate
from reobserve_papers.golden.comparison import compare
from reobserve_papers.golden.number_files import golden_file, read_numbers
from reobserve_papers.golden.values import evaluated_numbers
from reobserve_papers.parameters.parameters import default_parameters
from reobserve_papers.steps.evaluation import Evaluator
from tests import ROOT


def test_figure_has_its_golden_numbers() -> None:
    """All metrics and series, bitwise as computed by the steps of the workflow."""
    found = replicate("ilo", "fig1")
    evaluator = Evaluator(default_parameters(ROOT, "ilo"))
    assert repr(found.numbers) == repr(evaluator.figure("fig1").numbers)
    assert np.array_equal(found.plant["fault"], evaluator.figure("fig1").plant["fault"])
    golden = read_numbers(golden_file(ROOT, "ilo", "fig1"))
    assert list(compare(golden, evaluated_numbers(evaluator, "fig1"), "ilo fig1")) == []
    assert list(found.estimates) == ["sampled", "continuous", "forgetting"]
    assert found.estimates["sampled"]["fault"].shape == (len(found.estimates["sampled"].time), 3)
    assert found.study is None


def test_metrics_and_studies_are_data_frames() -> None:
    found = replicate("ilo", "fig4_matched")
    table = found.metrics
    assert list(table.columns) == ["observer", "metric", "value", "unit"]
    assert repr(table.to_dict("records")) == repr([vars(number) for number in found.numbers])
    assert found.study is not None
    assert found.rows is not None
    assert len(found.study) == len(found.rows) > 1


def test_override_changes_only_dependent_results() -> None:
    before = replicate("ilo", "fig1")
    after = replicate("ilo", "fig1", {"observers": {"sampled": {"K2": 500.0}}})
    assert np.array_equal(before.plant["fault"], after.plant["fault"])
    for name in before.estimates:
        same = np.array_equal(before.estimates[name]["fault"], after.estimates[name]["fault"])
        assert same == (name != "sampled")


PLOT = """
import matplotlib.style
from matplotlib import font_manager

matplotlib.style.use("dark_background")
matplotlib.rcParams["lines.linewidth"] = 7.0
before, fonts = dict(matplotlib.rcParams), font_manager.fontManager.ttflist

from reobserve_papers import replicate

drawn = replicate("ilo", "fig1").plot()
assert dict(matplotlib.rcParams) == before
assert font_manager.fontManager.ttflist is fonts
assert drawn.get_facecolor() == (1.0, 1.0, 1.0, 1.0)
assert abs(drawn.get_figwidth() - 6.6) < 1e-9
assert max(line.get_linewidth() for axes in drawn.axes for line in axes.lines) < 7
assert any(axes.get_ylabel() for axes in drawn.axes)
"""


def test_plot_has_the_workflow_style_without_changing_the_user_style() -> None:
    """In the process of a user with another style."""
    done = subprocess.run([sys.executable, "-c", PLOT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_recorded_samples_are_read_from_any_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("config", "workflow"):
        shutil.copytree(ROOT / name, tmp_path / "project" / name)
    (tmp_path / "project/torque.csv").write_text("time,torque\n0,0\n10,0.1\n")
    parameters = tmp_path / "project/config/papers/ilo.yaml"
    text = parameters.read_text()
    constant = "{kind: constant, axis: 1, from: 5.0, size: 0.5}"
    assert constant in text
    samples = "{kind: samples, axis: 1, file: torque.csv, column: torque}"
    parameters.write_text(text.replace(constant, samples, 1))
    monkeypatch.chdir("/")
    found = replicate("ilo", "fig1", project=tmp_path / "project")
    assert found.plant["fault"][-1, 0] == pytest.approx(0.1, rel=1e-12)


def test_repr_of_a_result_is_one_short_line() -> None:
    shown = repr(replicate("ilo", "fig1"))
    assert shown.startswith("<fig1 of ilo: observers sampled, continuous, forgetting; ")
    assert len(shown) < 200


def test_project_file_of_a_figure_is_read_from_any_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parameters = default_parameters(ROOT, "imm")
    (figure,) = (
        name
        for name, body in parameters.tree["figures"].items()
        if body.get("study") == "neighbourhood"
    )
    monkeypatch.chdir(tmp_path)
    few = {"studies": {"neighbourhood": {"factors": [1.05]}}}
    assert replicate("imm", figure, few).study is not None
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("ill", "fig1"), "paper: there is no 'ill'; did you mean 'ilo'?"),
        (("ilo", "fig11"), "figure: ilo has no 'fig11'; did you mean 'fig1'?"),
        (("ilo", ["fig1"]), r"figure: \['fig1'\] must be a name"),
        ((3, "fig1"), "paper: 3 must be a name"),
        (("ilo", "fig1", []), r"overrides: \[\] must be a mapping"),
        (("ilo", "fig1", {"observers": {"sampled": {"K22": 1}}}), "unknown key; did you mean 'K2'"),
        (("ilo", "fig1", {"observers": {"sampled": {"K2": 90_000}}}), "must give stable"),
    ],
)
def test_invalid_input_is_reported_in_one_sentence(
    arguments: tuple[object, ...], said: str
) -> None:
    with pytest.raises(InputError, match=said) as caught:
        replicate(*arguments)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


@pytest.mark.nightly
def test_installed_package_has_its_parameter_files(tmp_path: Path) -> None:
    """As installed by the wheel; `tests/package` compares that with the checkout."""
    site = tmp_path / "site"
    for package in (reobserve, reobserve_papers):
        (site / package.__name__).mkdir(parents=True)
        for path in Path(str(package.__file__)).parent.iterdir():
            (site / package.__name__ / path.name).symlink_to(path)
    (site / "reobserve_papers/project").mkdir()
    for name in ("config", "workflow"):
        (site / "reobserve_papers/project" / name).symlink_to(ROOT / name)
    program = (
        "import reobserve_papers; found = reobserve_papers.replicate('lie', 'fig1'); "
        "print(reobserve_papers.__file__, len(found.numbers))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], env={**os.environ, "PYTHONPATH": str(site)},
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(str(site))
