"""Two clean builds give the same bytes, on one core or two, interrupted or not."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from reobserve_papers.steps.freshness import record_of

from .conftest import CONFIG, PAPERS, Project

pytestmark = pytest.mark.nightly


def assert_same_files(first: dict[str, bytes], second: dict[str, bytes]) -> None:
    assert sorted(first) == sorted(second)
    assert [name for name in first if first[name] != second[name]] == []


# The evidence takes as long as the figures; that of the toy paper is made twice in its own tests.
KILLED = "ilo"  # built from scratch on one core, and interrupted
OTHERS = [paper for paper in PAPERS if paper != KILLED]
THEORIES = [f"results/{paper}/theory.metrics.csv" for paper in OTHERS]
TASK = "torque"  # of the bench
# The longest part, compared bitwise with the library in `test_same_values`.
TAKEN = ("*.design.json", "*/plant.parquet", "*.study.csv")
EVIDENCE = (
    "robustness.json", "alternatives.csv", "claims.csv", "verdicts.md", "report.html",
    *(
        f"/{name}.{kind}"
        for name in ("alternatives", "sensitivity")
        for kind in CONFIG["formats"]
    ),
)  # fmt: skip


# Plotted again for all papers except the killed one, which gets every format.
DRAWN = "svg"
NOT_DRAWN = tuple(f".{kind}" for kind in CONFIG["formats"] if kind != DRAWN)


def of_figures(project: Project) -> dict[str, bytes]:
    """The results without the evidence."""
    return {name: text for name, text in project.results().items() if not name.endswith(EVIDENCE)}


def take(project: Project, built: Project, pattern: str) -> None:
    """Copies of results and their records of another project, newer than the files here."""
    for paper in OTHERS:
        for path in (built.folder / "results" / paper).glob(pattern):
            name = str(path.relative_to(built.folder))
            record = record_of(built.folder, name), record_of(project.folder, name)
            for one, copy in ((path, project.folder / name), record):
                copy.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(one, copy)


def test_builds_on_one_and_two_cores_are_bitwise_identical(
    as_built: Project, built_bench: Project, fresh: Project
) -> None:
    """For everything made from records and studies; the next test builds from scratch."""
    for pattern in TAKEN:
        take(fresh, as_built, pattern)
    taken = {path: path.stat().st_mtime_ns for path in (fresh.folder / "results").rglob("*.*")}
    config = (f"papers={OTHERS}".replace("'", ""), f"formats=[{DRAWN}]", f"bench=[{TASK}]")
    asked = ("figures", "bench", *THEORIES, "--config", *config)
    fresh.run("snakemake", "--cores", "1", *asked)
    assert {path: path.stat().st_mtime_ns for path in taken} == taken
    results = fresh.results()
    assert results.pop("bench/table.md")  # of one task only
    assert {name.rpartition(".")[2] for name in results} == {
        "parquet", "csv", DRAWN, "rst", "json",
    }  # fmt: skip
    of_task = {
        name: text for name, text in built_bench.results().items()
        if name.startswith(f"bench/{TASK}/")
    }  # fmt: skip
    everything = {
        name: text for name, text in (of_figures(as_built) | of_task).items()
        if not name.endswith(NOT_DRAWN)
    }  # fmt: skip
    killed = [name for name in everything if name.startswith(f"{KILLED}/")]
    assert killed
    for name in killed:
        if name != f"{KILLED}/parameters.json":
            everything.pop(name)
    assert_same_files(everything, results)


def built_of_killed(project: Project) -> int:
    return sum(path.is_file() for path in (project.folder / "results" / KILLED).rglob("*"))


def test_killed_build_resumes_to_the_same_bytes(as_built: Project, fresh: Project) -> None:
    """SIGKILL of the whole process group, repeatedly, while the results of one paper grow.

    On one core, while the other was built on two.
    """
    everything = of_figures(as_built)
    parameters = {name: text for name, text in everything.items() if "/parameters.json" in name}
    mine = {name: text for name, text in everything.items() if name.startswith(f"{KILLED}/")}
    whole = parameters | mine
    whole.pop(f"{KILLED}/theory.metrics.csv")
    asked = ("figures", "--config", f"papers=[{KILLED}]")
    for wanted in (1, 9, 17, 29):
        build = subprocess.Popen(
            ["snakemake", "--cores", "1", *asked],
            cwd=fresh.folder, env=fresh.environment, start_new_session=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        deadline = time.monotonic() + 120
        while built_of_killed(fresh) < wanted and build.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.02)
        os.killpg(build.pid, signal.SIGKILL)
        assert build.wait() == -signal.SIGKILL, "the build was meant to be killed half-way"
        refused = fresh.snakemake(*asked, check=False)
        assert refused.returncode != 0
        assert "--unlock" in refused.stderr
        fresh.run("snakemake", "--unlock")
        for name, content in fresh.results().items():
            # A file under its final name is complete, whenever it was killed.
            assert ".partial" in name or content == whole[name], name
    fresh.run("snakemake", "--cores", "1", *asked)
    assert_same_files(whole, fresh.results())


def test_second_build_in_the_same_folder_is_refused(fresh: Project) -> None:
    target, other = "results/imm/fig8_causes.svg", "results/lie/figure/plant.parquet"
    first = subprocess.Popen(
        ["snakemake", "--cores", "1", target],
        cwd=fresh.folder, env=fresh.environment, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        while not (fresh.folder / "results/lie/parameters.json").exists():
            assert first.poll() is None
            time.sleep(0.02)
        os.killpg(first.pid, signal.SIGSTOP)  # so that it does not end before the others
        second = fresh.snakemake(target, check=False)
        stamp = fresh.folder / "installed"  # as if there were an environment
        stamp.write_text(f"{fresh.folder}\n")
        here = (f"STAMP={stamp}", f"BIN={Path(sys.executable).parent}")
        made = fresh.run("make", "figures", *here, check=False)
        changed = fresh.snakemake(other, "--config", "lie={plant: {step: 0.004}}", check=False)
        again = fresh.snakemake(target, check=False)
    finally:
        os.killpg(first.pid, signal.SIGKILL)
        first.wait()
    assert second.returncode != 0
    assert "Directory cannot be locked" in second.stderr
    assert "Traceback" not in second.stderr
    assert made.returncode != 0
    assert "one was killed: make unlock" in made.stderr
    assert changed.returncode != 0
    said = "reobserve-papers: another build runs in this folder, with other parameters of lie; wait"
    assert changed.stderr.rstrip().splitlines()[-1].startswith(said)
    assert "Directory cannot be locked" in again.stderr, "a refusal leaves the lock of others"
    # Also with parameters other than those of the killed build.
    fresh.run("snakemake", "--unlock", "--config", "lie={plant: {step: 0.004}}")
    fresh.snakemake("results/ilo/constant/plant.parquet")
