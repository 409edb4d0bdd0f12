"""The worked example of a paper: its files alone make a paper that all project rules cover."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from .conftest import FEW_SAMPLES, ROOT, Project, copy_project

pytestmark = pytest.mark.nightly

EXAMPLE = ROOT / "examples" / "two_mass"
FILES = [path for path in sorted(EXAMPLE.rglob("*")) if path.is_file() and "cache" not in str(path)]


def test_example_paper_needs_few_files_and_lines() -> None:
    assert len(FILES) <= 6
    assert sum(len(path.read_text().splitlines()) for path in FILES) <= 300


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A copy of the project with the committed example, and its figures built."""
    copy = copy_project(tmp_path_factory.mktemp("example"))
    for path in FILES:
        target = copy.folder / path.relative_to(EXAMPLE)
        assert not target.exists(), "the example must touch no other file"
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, target)
    git = ("git", "-c", "user.name=t", "-c", "user.email=t@example.org")
    copy.run("git", "init", "--quiet")
    copy.run("git", "add", "--all")
    copy.run(*git, "commit", "--quiet", "--message", "all")
    copy.snakemake("--config", "papers=[two_mass]", *FEW_SAMPLES)
    return copy


def test_example_builds_from_scratch(project: Project) -> None:
    made = {Path(name).name for name in project.results() if name.startswith("two_mass/")}
    assert {"fig1.pdf", "fig2.pdf", "noises.study.csv", "fast.design.json"} <= made
    claims = (project.folder / "results/claims.csv").read_text()
    assert claims.count("\ntwo_mass,") == 3
    assert "two_mass" in (project.folder / "results/report.html").read_text()
    assert project.stale(config=("papers=[two_mass]", *FEW_SAMPLES)) == {}


def test_example_results_depend_on_its_single_module(project: Project) -> None:
    module = project.folder / "src/reobserve_papers/papers/two_mass.py"
    kept = module.read_bytes()
    try:
        module.write_bytes(kept + b"# edited\n")
        stale = project.stale(config=("papers=[two_mass]", *FEW_SAMPLES))
    finally:
        module.write_bytes(kept)
    assert stale["plant"] == 2
    assert stale["observe"] == 4
    assert stale["plot"] == 2


def test_misspelt_layout_is_reported_before_anything_runs(project: Project) -> None:
    change = "two_mass={figures: {fig1: {layout: error}}}"
    done = project.snakemake("--config", "papers=[two_mass]", change, check=False)
    assert done.returncode != 0
    assert "figures.fig1.layout: 'error' must be one of errors, noises" in done.stdout + done.stderr


def test_project_rules_cover_the_example(project: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    """`accept` stores its golden numbers and lists its metrics; then all project rules hold."""
    monkeypatch.delenv("CI", raising=False)  # where accepting is refused
    project.run("reobserve-papers", "accept", "two_mass", "--reason", "a paper more")
    tests = (
        "tests/reobserve_papers/papers/test_two_mass.py",
        "tests/reobserve_papers/golden/test_golden.py",
    )
    watched = project.run("pytest", *tests, "-k", "two_mass and not numbers")
    assert " passed" in watched.stdout + watched.stderr or "100%" in watched.stdout
    project.run("ruff", "check", "src", "tests/reobserve_papers/papers")
    project.run("pytest", "tests/test_project.py")
