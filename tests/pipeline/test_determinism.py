"""Two clean builds give the same bytes, on one core or two, disturbed or not."""

from __future__ import annotations

import os
import signal
import subprocess
import time

from .conftest import CONFIG, LEDGERS, PAPERS, Project


def assert_same_files(first: dict[str, bytes], second: dict[str, bytes]) -> None:
    assert sorted(first) == sorted(second)
    assert [name for name in first if first[name] != second[name]] == []


# The evidence takes as long as the figures; the toy paper's is made twice in its own tests.
THEORIES = [
    f"results/{paper}/theory.metrics.csv" for paper in PAPERS if "theory" in LEDGERS[paper].tree
]
EVIDENCE = (
    "robustness.json", "claims.csv", "verdicts.md", "report.html",
    *(f"/{name}.{kind}" for name in ("specification", "sensitivity") for kind in CONFIG["formats"]),
)  # fmt: skip


def of_figures(project: Project) -> dict[str, bytes]:
    """What was built but the evidence."""
    return {name: text for name, text in project.results().items() if not name.endswith(EVIDENCE)}


def test_one_core_and_two_give_the_same_bytes(as_built: Project, fresh: Project) -> None:
    fresh.run("snakemake", "--cores", "1", "figures", *THEORIES)
    results = fresh.results()
    assert {name.rpartition(".")[2] for name in results} == {
        "parquet", "csv", "png", "svg", "pdf", "rst", "json",
    }  # fmt: skip
    assert_same_files(of_figures(as_built), results)


def built_of_ilo(project: Project) -> int:
    return sum(path.is_file() for path in (project.folder / "results/ilo").rglob("*"))


def test_a_killed_build_ends_with_the_same_bytes(as_built: Project, fresh: Project) -> None:
    """SIGKILL of the whole process group, again and again, as the results of one paper grow."""
    everything = of_figures(as_built)
    ledgers = {name: text for name, text in everything.items() if "/ledger.json" in name}
    mine = {name: text for name, text in everything.items() if name.startswith("ilo/")}
    whole = ledgers | mine
    whole.pop("ilo/theory.metrics.csv")
    for wanted in (1, 4, 9, 14, 19, 24, 29):
        build = subprocess.Popen(
            ["snakemake", "--cores", "2", "figures", "--config", "papers=[ilo]"],
            cwd=fresh.folder, env=fresh.environment, start_new_session=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        deadline = time.monotonic() + 120
        while built_of_ilo(fresh) < wanted and build.poll() is None:
            assert time.monotonic() < deadline
            time.sleep(0.02)
        os.killpg(build.pid, signal.SIGKILL)
        assert build.wait() == -signal.SIGKILL, "the build was meant to be killed half-way"
        for name, content in fresh.results().items():
            # What stands under its own name is whole, whenever the kill came.
            assert ".partial" in name or content == whole[name], name
    fresh.snakemake("figures", "--config", "papers=[ilo]")
    assert_same_files(whole, fresh.results())


def test_a_second_build_in_the_folder_is_refused(fresh: Project) -> None:
    target = "results/ilo/constant/plant.parquet"
    first = subprocess.Popen(
        ["snakemake", "--cores", "1", "results/ilo/fig4_matched.svg"],
        cwd=fresh.folder, env=fresh.environment, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    try:
        while not (fresh.folder / "results/ilo/ledger.json").exists():
            assert first.poll() is None
            time.sleep(0.02)
        second = fresh.snakemake(target, check=False)
    finally:
        os.killpg(first.pid, signal.SIGKILL)
        first.wait()
    assert second.returncode != 0
    assert second.stderr.strip().endswith(
        "reobserve: another build is running in this folder; wait for it to end"
    )
    fresh.snakemake(target)
