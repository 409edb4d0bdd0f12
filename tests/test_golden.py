"""The numbers behind each figure are the golden ones, and the comparison notices when one moves."""

from __future__ import annotations

import copy
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from reobserve.config import read_yaml
from reobserve.errors import InputError
from reobserve.evaluation import Evaluator
from reobserve.golden import compare, folder
from reobserve.ledger import Ledger, leaves

from .pipeline.conftest import ROOT, Project, copy_project

CONFIG = read_yaml(ROOT / "config" / "config.yaml")
PAPERS = CONFIG["papers"]


def default(paper: str) -> Ledger:
    return Ledger.load(ROOT, paper, seed=CONFIG["seed"])


FIGURES = [(paper, figure) for paper in PAPERS for figure in default(paper).tree["figures"]]
EVALUATORS = {paper: Evaluator(default(paper)) for paper in PAPERS}


@pytest.mark.parametrize(("paper", "figure"), FIGURES)
def test_the_numbers_are_golden(paper: str, figure: str) -> None:
    assert list(map(str, compare(EVALUATORS[paper], figure, folder(ROOT, paper)))) == []


Path_ = tuple[str | int, ...]


def twin(path: Path_) -> Path_:
    """The mirrored place of a matrix entry; any other place is its own."""
    in_matrix = len(path) == 2 and all(isinstance(step, int) for step in path)
    return path[::-1] if in_matrix else path


def constants() -> Iterator[tuple[str, str, Path_]]:
    """Every number of a ledger that is physics, a gain or a rule of the metrics, and not zero."""
    for paper in PAPERS:
        for key, entry in default(paper).entries():
            if entry.get("numerical") or key == "metrics.axis":
                continue
            for path, value in leaves(entry["value"]):
                words = isinstance(value, str | bool)
                if not words and value != 0 and path[-1:] != ("axis",):
                    if path != min(path, twin(path), key=str):
                        continue  # the other half of a symmetric matrix
                    yield paper, key, path


CONSTANTS = list(constants())


def perturbed(paper: str, key: str, path: Path_, factor: float = 1.01) -> Ledger:
    """The ledger with one number off by a per cent (in a symmetric matrix with its twin)."""
    ledger = default(paper)
    tree = copy.deepcopy(ledger.tree)
    entry: Any = tree
    for word in key.split("."):
        entry = entry[word]
    if not path:
        entry["value"] *= factor
    else:
        for way in {path, twin(path)}:
            inner = entry["value"]
            for step in way[:-1]:
                inner = inner[step]
            inner[way[-1]] *= factor
    return Ledger(paper, tree, ledger.seed)


def deviates(ledger: Ledger) -> str:
    """The first deviation from the golden numbers, or the sentence that refuses the ledger."""
    evaluator, unchanged = Evaluator(ledger), default(ledger.paper)
    try:
        for figure in ledger.tree["figures"]:
            # A figure that sees nothing of the change cannot deviate; plot sees most.
            if ledger.settings("plot", figure) == unchanged.settings("plot", figure):
                continue
            for deviation in compare(evaluator, figure, folder(ROOT, ledger.paper)):
                return str(deviation)
    except InputError as error:
        return f"refused: {error}"
    return ""


def test_the_list_of_constants_is_long_enough() -> None:
    keys = {key for paper, key, _ in CONSTANTS if paper == "ilo"}
    assert len(keys) > 30
    assert {"plant.inertia", "observers.sampled.K2", "observers.matched.integral_gain"} <= keys
    assert sum(key == "plant.inertia" for _, key, _ in CONSTANTS) == 4


@pytest.mark.parametrize(("paper", "key", "path"), CONSTANTS)
def test_one_per_cent_of_any_constant_is_noticed(paper: str, key: str, path: Path_) -> None:
    # K1 = 1.01 would be refused as unstable, which is no proof that the numbers are compared.
    factor = 0.99 if key.endswith(".K1") else 1.01
    said = deviates(perturbed(paper, key, path, factor))
    assert said
    # Refused instead of off is only what must fit the grid, and the levels of a study, after
    # which its metrics are named.
    refused = (".interval", ".noise_period", ".integral_gains", ".noise_levels")
    assert said.startswith("refused: ") == key.endswith(refused), said


@pytest.mark.parametrize(
    ("key", "factor"),
    [
        ("observers.sampled.interval", 1.25),
        ("observers.continuous.interval", 1.025),
        ("observers.forgetting.interval", 1.025),
        ("plant.noise_period", 1.25),
    ],
)
def test_one_step_more_of_an_interval_is_noticed(key: str, factor: float) -> None:
    said = deviates(perturbed("ilo", key, (), factor))
    assert said
    assert not said.startswith("refused")


def git(project: Project, *arguments: str) -> None:
    project.run("git", "-c", "user.name=t", "-c", "user.email=t@example.org", *arguments)


@pytest.fixture
def checkout(tmp_path: Path) -> Project:
    """A committed copy, with CI off, whatever runs these tests."""
    project = copy_project(tmp_path)
    git(project, "init", "--quiet")
    git(project, "add", "--all")
    git(project, "commit", "--quiet", "--message", "all")
    return project


def update(project: Project, *arguments: str, ci: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["reobserve", "golden", "update", *arguments],
        cwd=project.folder, env={**project.environment, "CI": ci},
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_the_golden_test_fails_in_a_copy_with_another_constant(tmp_path: Path) -> None:
    """From end to end: pytest itself, on a copy whose config says 36.36 where it said 36."""
    project = copy_project(tmp_path)
    config = project.folder / "config/papers/ilo.yaml"
    config.write_text(config.read_text().replace("[36.0, 1.5, 0.0]", "[36.36, 1.5, 0.0]"))
    done = project.run(
        "pytest", "tests/test_golden.py", "-k", "numbers_are_golden", check=False
    )  # fmt: skip
    assert done.returncode == 1
    assert f"{len(FIGURES)} failed" in done.stdout
    assert "ilo fig1, plant.rate_" in done.stdout


def test_renewing_is_guarded(checkout: Project) -> None:
    before = (checkout.folder / "tests/golden/ilo/fig1.metrics.csv").read_bytes()
    assert "must say in three words" in update(checkout, "--reason", "because").stderr
    assert "not renewed in CI" in update(checkout, "--reason", "a good reason", ci="true").stderr
    (checkout.folder / "README.md").open("a").write("x")
    said = update(checkout, "--reason", "a good reason")
    assert said.returncode == 1
    assert "1 uncommitted changes, the first is 'README.md'" in said.stderr
    assert (checkout.folder / "tests/golden/ilo/fig1.metrics.csv").read_bytes() == before


def test_renewing_prints_old_and_new_and_keeps_the_reason(checkout: Project) -> None:
    config = checkout.folder / "config/papers/ilo.yaml"
    config.write_text(
        config.read_text().replace("size: 0.5}\n      unit", "size: 0.6}\n      unit")
    )
    git(checkout, "commit", "--quiet", "--all", "--message", "another stuck value")
    checked = checkout.run("reobserve", "golden", "check", check=False)
    assert checked.returncode == 1
    assert "golden numbers moved" in checked.stderr
    said = update(checkout, "--reason", "the stuck value is another")
    assert said.returncode == 0, said.stderr
    assert "ilo fig1, plant.fault_1 at 5 s: golden 0.5, found 0.6" in said.stdout
    assert "ilo fig2" not in said.stdout
    log = (checkout.folder / "tests/golden/REASONS.md").read_text()
    assert "the stuck value is another" in log.splitlines()[-1]
    checkout.run("reobserve", "golden", "check")


def test_unchanged_numbers_renew_to_the_same_bytes(checkout: Project) -> None:
    golden = checkout.folder / "tests/golden/ilo"
    before = {path.name: path.read_bytes() for path in golden.iterdir()}
    assert update(checkout, "--reason", "nothing has changed").returncode == 0
    assert {path.name: path.read_bytes() for path in golden.iterdir()} == before


@pytest.mark.parametrize(
    ("name", "damage", "said"),
    [
        (
            "fig1.metrics.csv",
            lambda text: text.replace("sampled,rms", "smpled,rms"),
            "does not fit",
        ),
        ("fig1.metrics.csv", lambda text: text[: len(text) // 2], "line"),
        ("fig1.series.csv", lambda text: text.replace("0.5", "half", 1), "must be"),
        ("fig1.tolerances.csv", lambda text: "", "has the columns"),
    ],
)
def test_a_damaged_golden_file_is_named(tmp_path: Path, name: str, damage: Any, said: str) -> None:
    shutil.copytree(folder(ROOT, "ilo"), tmp_path, dirs_exist_ok=True)
    path = tmp_path / name
    path.write_text(damage(path.read_text()))
    with pytest.raises(InputError, match=said) as caught:
        list(compare(EVALUATORS["ilo"], "fig1", tmp_path))
    assert str(path) in str(caught.value)
    os.remove(path)
    with pytest.raises(InputError, match="cannot be read"):
        list(compare(EVALUATORS["ilo"], "fig1", tmp_path))
