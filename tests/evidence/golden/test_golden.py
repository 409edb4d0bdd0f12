"""The numbers behind each figure are the golden ones, and the comparison notices when one moves."""

from __future__ import annotations

import copy
import os
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve.errors import InputError, ReobserveError
from reobserve.evidence.golden.files import folder, read_undetermined
from reobserve.evidence.golden.guard import check_may_renew
from reobserve.evidence.golden.kept import part_names, record_names
from reobserve.ledger.ledger import Ledger, leaves, matches
from reobserve.replication.evaluation import Evaluator
from tests.evidence.golden.deviations import FEW, deviations, deviations_of_few
from tests.pipeline.conftest import (
    EVALUATORS,
    FEW_LEVELS,
    LEDGERS,
    PAPERS,
    ROOT,
    Project,
    copy_project,
    with_few_levels,
)

# Words in a key or a place in its value that have names in the form of numbers behind them.
NAMES = {"axis", "component", "powers"}
PARTS = [
    (paper, part)
    for paper in PAPERS
    for part in part_names(LEDGERS[paper].tree)
    if (paper, part) not in FEW
]


@pytest.mark.parametrize(("paper", "part"), PARTS)
def test_the_numbers_are_golden(paper: str, part: str) -> None:
    """Those of the dearest studies, of which there are few levels here, where they are built."""
    assert list(deviations(EVALUATORS[paper], part)) == []


@pytest.mark.parametrize("paper", PAPERS)
def test_every_number_is_kept_once_and_no_other(paper: str) -> None:
    tree, golden = LEDGERS[paper].tree, folder(ROOT, paper)
    parts = {
        path.relative_to(golden).as_posix().partition(".")[0] for path in golden.rglob("*.csv")
    }
    left_out = {part for part in read_undetermined(golden) if part in record_names(tree)}
    assert parts | left_out == {*part_names(tree), *record_names(tree)}


Path_ = tuple[str | int, ...]


def twin(path: Path_, value: Any) -> Path_:
    """The mirrored place of an entry of a symmetric matrix; any other place is its own."""
    if len(path) != 2 or not all(isinstance(step, int) for step in path):
        return path
    square = all(len(row) == len(value) for row in value)
    symmetric = square and value == list(map(list, zip(*value, strict=True)))
    return path[::-1] if symmetric else path


# Flags of entries that no golden number need depend on; the schema says what each means.
_UNNOTICED = ("numerical", "levels", "drawn", "expensive")


def constants() -> Iterator[tuple[str, str, Path_]]:
    """Every number of a ledger that is physics, a gain or a rule of the metrics, and not zero."""
    for paper in PAPERS:
        end = LEDGERS[paper].section("plant").get("horizon", np.inf)
        for key, entry in LEDGERS[paper].entries():
            # What a search looks at makes no figure: that is what it finds. Nor does what a theory
            # is tried on, and each try would compute the whole theory.
            searched = key.startswith(("searches.", "theory."))
            if searched or any(map(entry.get, _UNNOTICED)):
                continue
            loose = entry.get("loose", [])
            for path, value in leaves(entry["value"]):
                if loose is True or any(matches(place, path) for place in loose or ()):
                    continue
                words = isinstance(value, str | bool)
                # A term that starts before anyone looks back, or ends when all is over.
                unseen = not words and (
                    (path[-1:] == ("from",) and value < 0)
                    or (path[-1:] == ("until",) and value >= end)
                )
                named = NAMES & {*key.split("."), *path}
                if not words and not unseen and value != 0 and not named:
                    if path != min(path, twin(path, entry["value"]), key=str):
                        continue  # the other half of a symmetric matrix
                    yield paper, key, path


CONSTANTS = list(constants())


def perturbed(paper: str, key: str, path: Path_, factor: float) -> Ledger:
    """The ledger with one number off by a per cent (in a symmetric matrix with its twin)."""
    ledger = LEDGERS[paper]
    tree = copy.deepcopy(ledger.tree)
    entry: Any = tree
    for word in key.split("."):
        entry = entry[word]
    if not path:
        entry["value"] *= factor
    else:
        for way in {path, twin(path, entry["value"])}:
            inner = entry["value"]
            for step in way[:-1]:
                inner = inner[step]
            inner[way[-1]] *= factor
    return Ledger(paper, tree, ledger.seed)


@pytest.mark.parametrize(("paper", "figure"), FEW)
def test_few_levels_give_the_golden_numbers_of_theirs(paper: str, figure: str) -> None:
    evaluator = EVALUATORS[paper].sibling(with_few_levels(LEDGERS[paper]))
    assert list(deviations_of_few(evaluator, figure)) == []


def without_and_with_study(ledger: Ledger) -> list[str]:
    """Figures in the order in which they are made: those with studies last."""
    figures = ledger.tree["figures"]
    return sorted(figures, key=lambda one: figures[one].get("study") is not None)


def noticed(paper: str, key: str, path: Path_, factors: tuple[float, ...] = (1.01, 0.99)) -> str:
    """The first deviation from the golden numbers if one of these factors is on a number.

    Else the sentence that refuses the last of them, if it is refused.
    """
    unchanged, refused = LEDGERS[paper], ""
    # What a stage sees no change of is not computed again. A copy, so that the rest is let go.
    done = dict(EVALUATORS[paper]._done)
    tries = [Evaluator(perturbed(paper, key, path, factor), done) for factor in factors]
    _, study, level = (*key.split("."), "", "")[:3]
    few = [] if level in FEW_LEVELS.get(study, {}) else FEW  # or it would not be seen

    def deviates(evaluator: Evaluator, stage: str, part: str) -> str:
        ledger = evaluator.ledger
        # A part that sees nothing of the change cannot deviate; plot sees most.
        if ledger.settings(stage, part) == unchanged.settings(stage, part):
            return ""
        if (paper, part) in few:
            less = evaluator.sibling(with_few_levels(ledger))
            return next(deviations_of_few(less, part), "")
        return next(deviations(evaluator, part), "")

    parts = [("plot", figure) for figure in without_and_with_study(unchanged)]
    parts += [("table", table) for table in unchanged.tree.get("tables", {})]
    for stage, part in parts:
        for evaluator in list(tries):
            try:
                said = deviates(evaluator, stage, part)
            except InputError as error:
                refused = f"refused: {error}" if evaluator is tries[-1] else ""
                tries.remove(evaluator)
                continue
            if said:
                return said
    return refused


def test_the_list_of_constants_is_long_enough() -> None:
    keys = {key for paper, key, _ in CONSTANTS if paper == "ilo"}
    assert len(keys) > 30
    assert {"plant.inertia", "observers.sampled.K2", "observers.matched.integral_gain"} <= keys
    assert sum((paper, key) == ("ilo", "plant.inertia") for paper, key, _ in CONSTANTS) == 4


def in_steps(paper: str, key: str, path: Path_) -> bool:
    """Whether a number is whole, on a grid or one of some choices: a per cent is no step of it."""
    entry = dict(LEDGERS[paper].entries())[key]
    value = dict(leaves(entry["value"]))[path]
    return isinstance(value, int) or "multiple_of" in entry or "choices" in entry.get("range", ())


@pytest.mark.parametrize(("paper", "key", "path"), CONSTANTS)
def test_one_per_cent_of_any_constant_is_noticed(paper: str, key: str, path: Path_) -> None:
    """A per cent less where more is refused or changes nothing, as of a window's end that is the
    run's.
    """
    said = noticed(paper, key, path)
    assert said
    assert in_steps(paper, key, path) or not said.startswith("refused: "), said


@pytest.mark.parametrize(
    ("key", "factor"),
    [
        ("observers.sampled.update_interval", 1.25),
        ("observers.continuous.update_interval", 1.025),
        ("observers.forgetting.update_interval", 1.025),
        ("plant.noise_period", 1.25),
    ],
)
def test_one_step_more_of_an_interval_is_noticed(key: str, factor: float) -> None:
    said = noticed("ilo", key, (), (factor,))
    assert said
    assert not said.startswith("refused")


def git(project: Project, *arguments: str) -> None:
    project.run("git", "-c", "user.name=t", "-c", "user.email=t@example.org", *arguments)


@pytest.fixture
def checkout(tmp_path: Path) -> Project:
    """A committed copy that builds one paper, with CI off, whatever runs these tests."""
    project = copy_project(tmp_path)
    config = project.folder / "config/config.yaml"
    config.write_text(f"{config.read_text()}papers: [ilo]\n")
    git(project, "init", "--quiet")
    git(project, "add", "--all")
    git(project, "commit", "--quiet", "--message", "all")
    return project


def update(
    project: Project, *arguments: str, ci: str = "", kernel: str = "Nehalem"
) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["reobserve", "golden", "update", *arguments], cwd=project.folder,
        env={**project.environment, "CI": ci, "OPENBLAS_CORETYPE": kernel},
        capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_the_golden_test_fails_in_a_copy_with_another_constant(tmp_path: Path) -> None:
    """From end to end: pytest itself, on a copy whose config says 36.36 where it said 36."""
    project = copy_project(tmp_path)
    config = project.folder / "config/papers/ilo.yaml"
    config.write_text(config.read_text().replace("[36.0, 1.5, 0.0]", "[36.36, 1.5, 0.0]"))
    done = project.run(
        "pytest", "tests/evidence/golden/test_golden.py", "-k", "numbers_are_golden and ilo-",
        check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert f"{len(part_names(LEDGERS['ilo'].tree))} failed" in done.stdout
    assert "ilo constant/plant, rate_" in done.stdout


def test_renewing_is_guarded(checkout: Project) -> None:
    before = (checkout.folder / "tests/golden/ilo/fig1.metrics.csv").read_bytes()
    assert "must say in three words" in update(checkout, "--reason", "because").stderr
    assert "not renewed in CI" in update(checkout, "--reason", "a good reason", ci="true").stderr
    (checkout.folder / "README.md").open("a").write("x")
    said = update(checkout, "--reason", "a good reason")
    assert said.returncode == 1
    assert "1 uncommitted changes, the first is 'README.md'" in said.stderr
    assert (checkout.folder / "tests/golden/ilo/fig1.metrics.csv").read_bytes() == before


def test_what_is_no_checkout_is_not_renewed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CI", "")
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    with pytest.raises(ReobserveError, match=r"^golden numbers are renewed in a git checkout: fat"):
        check_may_renew(tmp_path, "a good reason")


def test_renewing_where_nothing_has_changed_changes_no_byte(checkout: Project) -> None:
    """On another processor, whose last places are other than those that are kept."""
    golden = folder(checkout.folder, "ilo")
    kept = {path: path.read_bytes() for path in golden.rglob("*.*")}
    said = update(checkout, "ilo", "--reason", "nothing has changed", kernel="Haswell")
    assert said.returncode == 0, said.stderr
    # Not even a reason is kept: there is nothing to explain.
    assert checkout.run("git", "status", "--porcelain").stdout == ""
    assert said.stdout.splitlines()[-1] == "nothing moved beyond its tolerance"
    assert {path: path.read_bytes() for path in golden.rglob("*.*")} == kept


@pytest.mark.parametrize(
    ("name", "damage", "said"),
    [
        (
            "fig1.metrics.csv",
            lambda text: text.replace("sampled,rms", "smpled,rms"),
            "does not fit",
        ),
        ("fig1.metrics.csv", lambda text: text[: text.rindex(",")], "line"),
        ("constant/plant.series.csv", lambda text: text.replace("0.5", "half", 1), "must be"),
        ("constant/plant.series.csv", lambda text: text.partition("\n")[0] + "\n", "has no rows"),
        ("constant/plant.tolerances.csv", lambda text: "", "has the columns"),
        (
            "constant/plant.tolerances.csv",
            lambda text: text[: text.rindex(",") + 1] + "-1e-9\n",
            r"holds the tolerance \S+, -1e-09; both must be >= 0",
        ),
    ],
)
def test_a_damaged_golden_file_is_named(tmp_path: Path, name: str, damage: Any, said: str) -> None:
    shutil.copytree(folder(ROOT, "ilo"), tmp_path, dirs_exist_ok=True)
    path = tmp_path / name
    path.write_text(damage(path.read_text()))
    with pytest.raises(InputError, match=said) as caught:
        list(deviations(EVALUATORS["ilo"], "fig1", tmp_path))
    assert str(path) in str(caught.value)
    os.remove(path)
    with pytest.raises(InputError, match="cannot be read"):
        list(deviations(EVALUATORS["ilo"], "fig1", tmp_path))
