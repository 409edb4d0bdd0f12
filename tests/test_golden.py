"""The numbers behind each figure are the golden ones, and the comparison notices when one moves."""

from __future__ import annotations

import copy
import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reobserve import golden_tables
from reobserve.errors import InputError
from reobserve.evaluation import Evaluation, Evaluator
from reobserve.golden import (
    THEORY,
    compare,
    compare_metrics,
    compare_series,
    folder,
    write,
    write_theory,
)
from reobserve.ledger import Ledger, leaves
from reobserve.metrics import Metric
from reobserve.series import Channel, Series

from .pipeline.conftest import FIGURES, LEDGERS, PAPERS, ROOT, TABLES, Project, copy_project

# Ends of keys, by paper. Of some constants one per cent can only be refused: what must fit the
# grid, and the levels of a study, after which its metrics are named.
ONLY_REFUSED = {
    "ilo": (".interval", ".noise_period", ".integral_gains", ".noise_levels"),
    "lie": (".order", ".orders", ".degree", ".points"),  # whole numbers
    "delay": (".order", ".noise_period", ".mean_delay", ".sampling", "relay.step_size"),
    "imm": (".plain.period", ".step.period", ".share", ".clock", ".order"),
}
# Others are names in the form of numbers, no constants: whole keys, and places inside a value.
NO_CONSTANTS = {
    "ilo": ("metrics.axis",),
    # Levels of studies, after which metrics are named; each would run its study for nothing.
    "delay": ("tradeoff.rhos", "tuning.rhos", "tuning.forgetting", "tuning.relay_gains"),
    "imm": (
        "neighbourhood.factors",
        "changes.periods",
        "changes.shares",
        "changes.layer_factors",
        "closeness.shares",
        "closeness.noise_levels",
        "closeness.input",
        "closeness.horizon",
    ),
    # The longest lag is a bound that no lag comes near.
    "eso": (
        "designs.filter_rates",
        "designs.decays",
        "designs.factors",
        "designs.pole_bounds",
        "metrics.longest_lag",
    ),
}
NAMES = {"axis", "component", "powers"}
# K1 = 1.01 would be refused as unstable, which is no proof that the numbers are compared.
# A window that ends with the run cannot end later.
MADE_LESS = {"ilo": (".K1",), "imm": ("metrics.after",)}

EVALUATORS = {paper: Evaluator(ledger) for paper, ledger in LEDGERS.items()}


@pytest.mark.parametrize(("paper", "figure"), FIGURES)
def test_the_numbers_are_golden(paper: str, figure: str) -> None:
    assert (
        list(
            map(str, compare(EVALUATORS[paper].figure(figure), paper, figure, folder(ROOT, paper)))
        )
        == []
    )


def test_the_tables_are_golden() -> None:
    for paper, table in TABLES:
        found = golden_tables.compare(EVALUATORS[paper], table, folder(ROOT, paper))
        assert list(map(str, found)) == []


THEORIES = [paper for paper in PAPERS if THEORY in LEDGERS[paper].tree]


@pytest.mark.parametrize("paper", THEORIES)
def test_the_theory_is_golden(paper: str) -> None:
    found = compare_metrics(EVALUATORS[paper].theory(), paper, THEORY, folder(ROOT, paper))
    assert list(map(str, found)) == []


Path_ = tuple[str | int, ...]


def twin(path: Path_, value: Any) -> Path_:
    """The mirrored place of an entry of a symmetric matrix; any other place is its own."""
    if len(path) != 2 or not all(isinstance(step, int) for step in path):
        return path
    square = all(len(row) == len(value) for row in value)
    symmetric = square and value == list(map(list, zip(*value, strict=True)))
    return path[::-1] if symmetric else path


def constants() -> Iterator[tuple[str, str, Path_]]:
    """Every number of a ledger that is physics, a gain or a rule of the metrics, and not zero."""
    for paper in PAPERS:
        end = LEDGERS[paper].section("plant").get("horizon", np.inf)
        for key, entry in LEDGERS[paper].entries():
            # What a search looks at makes no figure: that is what it finds. Nor does what a theory
            # is tried on, and each try would compute the whole theory.
            searched = key.startswith(("searches.", "theory."))
            if searched or entry.get("numerical") or key.endswith(NO_CONSTANTS.get(paper, ())):
                continue
            for path, value in leaves(entry["value"]):
                words = isinstance(value, str | bool)
                # A term that starts before anyone looks back, or ends when all is over.
                unseen = not words and (
                    (path[-1:] == ("from",) and value < 0)
                    or (path[-1:] == ("until",) and value >= end)
                )
                if not words and not unseen and value != 0 and not NAMES & set(path):
                    if path != min(path, twin(path, entry["value"]), key=str):
                        continue  # the other half of a symmetric matrix
                    yield paper, key, path


CONSTANTS = list(constants())


def perturbed(paper: str, key: str, path: Path_, factor: float = 1.01) -> Ledger:
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


def deviates(ledger: Ledger) -> str:
    """The first deviation from the golden numbers, or the sentence that refuses the ledger."""
    unchanged = LEDGERS[ledger.paper]
    # What a stage sees no change of is not computed again. A copy, so that the rest is let go.
    evaluator = Evaluator(ledger, dict(EVALUATORS[ledger.paper]._done))
    kept = folder(ROOT, ledger.paper)
    try:
        for figure in ledger.tree["figures"]:
            # A figure that sees nothing of the change cannot deviate; plot sees most.
            if ledger.settings("plot", figure) == unchanged.settings("plot", figure):
                continue
            for deviation in compare(evaluator.figure(figure), ledger.paper, figure, kept):
                return str(deviation)
        for table in ledger.tree.get("tables", {}):
            if ledger.settings("table", table) != unchanged.settings("table", table):
                for cell in golden_tables.compare(evaluator, table, kept):
                    return str(cell)
    except InputError as error:
        return f"refused: {error}"
    return ""


def test_the_list_of_constants_is_long_enough() -> None:
    keys = {key for paper, key, _ in CONSTANTS if paper == "ilo"}
    assert len(keys) > 30
    assert {"plant.inertia", "observers.sampled.K2", "observers.matched.integral_gain"} <= keys
    assert sum((paper, key) == ("ilo", "plant.inertia") for paper, key, _ in CONSTANTS) == 4


@pytest.mark.parametrize(("paper", "key", "path"), CONSTANTS)
def test_one_per_cent_of_any_constant_is_noticed(paper: str, key: str, path: Path_) -> None:
    factor = 0.99 if key.endswith(MADE_LESS.get(paper, ())) else 1.01
    said = deviates(perturbed(paper, key, path, factor))
    assert said
    only_refused = any(
        place.endswith(ONLY_REFUSED.get(paper, ()))
        for place in (key, ".".join(map(str, (key, *path))))
    )
    assert said.startswith("refused: ") == only_refused, said


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
    """A committed copy that builds one paper, with CI off, whatever runs these tests."""
    project = copy_project(tmp_path)
    config = project.folder / "config/config.yaml"
    config.write_text(re.sub(r"^papers: \[.*?\]", "papers: [ilo]", config.read_text(), flags=re.M))
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
        "pytest", "tests/test_golden.py", "-k", "numbers_are_golden and ilo-", check=False
    )  # fmt: skip
    assert done.returncode == 1
    assert f"{len(LEDGERS['ilo'].tree['figures'])} failed" in done.stdout
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
    said = update(checkout, "ilo", "--reason", "the stuck value is another")
    assert said.returncode == 0, said.stderr
    assert "ilo fig1, plant.fault_1 at 5 s: golden 0.5, found 0.6" in said.stdout
    assert "ilo fig2" not in said.stdout
    log = (checkout.folder / "tests/golden/REASONS.md").read_text()
    assert "the stuck value is another" in log.splitlines()[-1]
    checkout.run("reobserve", "golden", "check")


def test_unchanged_numbers_renew_to_the_same_bytes(checkout: Project) -> None:
    papers = ("ilo", "lie")  # of all kinds of numbers; the thousand runs of others take too long
    kept = [path for paper in papers for path in folder(checkout.folder, paper).iterdir()]
    before = {path: path.read_bytes() for path in kept}
    assert update(checkout, *papers, "--reason", "nothing has changed").returncode == 0
    assert {path: path.read_bytes() for path in kept} == before


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
        list(compare(EVALUATORS["ilo"].figure("fig1"), "ilo", "fig1", tmp_path))
    assert str(path) in str(caught.value)
    os.remove(path)
    with pytest.raises(InputError, match="cannot be read"):
        list(compare(EVALUATORS["ilo"].figure("fig1"), "ilo", "fig1", tmp_path))


class OneSeries(Evaluator):
    """An evaluator whose figure is one signal in one unit."""

    def __init__(self, unit: str) -> None:
        super().__init__(LEDGERS["ilo"])
        self.unit = unit

    def figure(self, figure: str) -> Evaluation:
        time = np.arange(3) * 0.1
        return Evaluation(Series(time, {"x": Channel(10 * time, self.unit)}), {}, None, [])


def test_a_unit_must_have_a_rounding(tmp_path: Path) -> None:
    write(OneSeries("1/s"), OneSeries("1/s"), "fig1", tmp_path)
    assert "plant.x,1/s,2e-09," in (tmp_path / "fig1.tolerances.csv").read_text()
    with pytest.raises(InputError, match=r"plant\.x: has the unit 'kg', of which .* 1/s"):
        write(OneSeries("kg"), OneSeries("kg"), "fig1", tmp_path)


class Theory(Evaluator):
    """An evaluator whose theory is one number, and a ratio that does not exist."""

    def __init__(self, value: float, unit: str = "1/s") -> None:
        super().__init__(LEDGERS["ilo"])
        self.metrics = [Metric("law", "pole", value, unit), Metric("law", "ratio", np.nan, "1")]

    def theory(self) -> list[Metric]:
        return self.metrics


@pytest.mark.parametrize(
    ("found", "moved"),
    [
        (-2.0, []),
        (-2.0 + 1.9e-3, []),
        (
            -2.0 + 2.1e-3,
            ["ilo theory, law:pole: golden -2, found -1.9979, off by 0.0021, allowed 0.002"],
        ),
    ],
)
def test_the_numbers_of_a_theory_have_tolerances(
    tmp_path: Path, found: float, moved: list[str]
) -> None:
    """Twice what halving the steps changes: here from -2 to -2.001."""
    write_theory(Theory(-2.0), Theory(-2.001), tmp_path)
    metrics = Theory(found).theory()
    assert list(map(str, compare_metrics(metrics, "ilo", THEORY, tmp_path))) == moved
    with pytest.raises(InputError, match=r"theory\.metrics\.csv: does not fit"):
        list(compare_metrics(metrics[:1], "ilo", THEORY, tmp_path))


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ([0.0, 1.0, 2.0], []),
        ([0.0, 1.0, 2.0 + 1e-12], []),
        ([0.0, 1.0, 2.0 + 1e-6], ["plant.x at 0.2 s"]),
        ([0.0, np.nan, 2.0], ["plant.x at 0.1 s"]),
        ([np.nan, np.nan, np.nan], ["plant.x at 0 s"]),
        ([0.0, np.inf, 2.0], ["plant.x at 0.1 s"]),
        ([0.0, 1.0], ["rows of plant.x"]),
        ([0.0, 1.0, 2.0, 3.0], ["rows of plant.x"]),
    ],
)
def test_a_series_deviates_by_value_by_nan_and_by_length(
    tmp_path: Path, values: list[float], said: list[str]
) -> None:
    write(OneSeries("1/s"), OneSeries("1/s"), "fig1", tmp_path)
    found = {"plant.x": Channel(np.array(values), "1/s")}
    assert [moved.what for moved in compare_series(found, "ilo", "fig1", tmp_path)] == said
