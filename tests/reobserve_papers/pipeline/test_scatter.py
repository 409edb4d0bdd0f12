"""Samples in chunks as jobs: locally, and on a single-node Slurm where one of them is killed."""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from reobserve.core.documents import read_yaml

from .conftest import ROOT, Project, copy_toy
from .slurm_node import ask, missing, slurm_node
from .test_staleness import edited

ROBUSTNESS = "results/toy/robustness.json"
WHOLE = ("samples=40",)

PLUGIN = Path(sys.prefix) / "cluster"  # where .ci/run writes it
LACKING = "on Debian and Ubuntu: apt-get install slurmctld slurmd slurm-client munge"
NO_PLUGIN = "no executor for Slurm in this environment: make cluster"


@pytest.fixture(scope="module")
def toy(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """The project with `toy` as its only paper."""
    return copy_toy(tmp_path_factory.mktemp("toy"))


@pytest.fixture(scope="module")
def in_one(toy: Project) -> bytes:
    """The result of a single job for all samples."""
    toy.snakemake(ROBUSTNESS, "--config", *WHOLE)
    assert not (toy.folder / "results/toy/samples").exists()
    return (toy.folder / ROBUSTNESS).read_bytes()


def test_slurm_profile_lists_exactly_the_existing_rules() -> None:
    profile = read_yaml(ROOT / "profiles/slurm/config.yaml")
    text = "".join(path.read_text() for path in (ROOT / "workflow").rglob("*.smk"))
    alone, grouped = {*profile["set-resources"]}, {*profile["groups"]}
    assert not alone & grouped
    assert alone | grouped | {"search"} == set(re.findall(r"^rule (\w+):", text, re.MULTILINE))


def chunks(toy: Project) -> list[str]:
    names = (path.stem for path in (toy.folder / "results/toy/samples").glob("*.json"))
    return sorted(names, key=lambda name: int(name.partition("-")[0]))


@pytest.mark.nightly
def test_sample_chunks_as_jobs_give_the_same_bytes(toy: Project, in_one: bytes) -> None:
    toy.snakemake(ROBUSTNESS, "--config", *WHOLE, "chunks=4")
    assert chunks(toy) == ["0-9", "10-19", "20-29", "30-39"]
    assert (toy.folder / ROBUSTNESS).read_bytes() == in_one
    more = ["samples=70", "chunks=7"]
    assert toy.stale(ROBUSTNESS, config=more) == {"sample": 3, "robustness": 1}
    (toy.folder / ROBUSTNESS).unlink()
    (toy.folder / "results/toy/samples/30-39.json").unlink()
    lost = toy.stale(ROBUSTNESS, config=[*WHOLE, "chunks=4"])
    assert lost == {"sample": 1, "robustness": 1}


@pytest.mark.nightly
def test_sample_chunks_are_stale_after_their_inputs_change(toy: Project, in_one: bytes) -> None:
    """In the same build, also if a study before them has to run first."""
    config = [*WHOLE, "chunks=2"]
    toy.snakemake(ROBUSTNESS, "--config", *config)
    gain = "toy={observers: {slow: {gains: [0.9, 1.1]}}}"
    assert toy.stale(ROBUSTNESS, config=[*config, gain])["sample"] == 2
    with edited(toy.folder / "src/toy_paper/study.py"):
        stale = toy.stale(ROBUSTNESS, config=config)
    assert stale == {"study": 1, "sample": 2, "robustness": 1}
    assert toy.stale(ROBUSTNESS, config=config) == {}


@pytest.fixture
def slurm() -> Iterator[dict[str, str]]:
    """The variables of a running Slurm. Without it tests are skipped; in CI they fail."""
    without = f"no {', '.join(missing())}; {LACKING}" if missing() else ""
    if not (importlib.util.find_spec("snakemake_executor_plugin_slurm") or PLUGIN.is_dir()):
        without = without or NO_PLUGIN
    if without:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(without)
    folder = tempfile.TemporaryDirectory(prefix="slurm-")
    with folder as name, slurm_node(Path(name)) as environment:
        yield environment


def test_slurm_runs_all_jobs_and_restarts_a_killed_one(
    toy: Project, in_one: bytes, slurm: dict[str, str]
) -> None:
    """Slurm jobs: everything after the figures, two chunks (one of them twice), the job that
    gathers them, and all later ones.
    """
    shutil.rmtree(toy.folder / "results/toy")
    paths = (toy.environment["PYTHONPATH"], str(PLUGIN))
    environment = toy.environment | slurm | {"PYTHONPATH": os.pathsep.join(paths)}
    command = (
        "snakemake", "--profile", "profiles/slurm", "--cores", "2", "--latency-wait", "5",
        "--slurm-no-account", "--slurm-status-command", "squeue",
        "--slurm-init-seconds-before-status-checks", "1", "--seconds-between-status-checks", "3",
        "--config", *WHOLE, "chunks=2",
    )  # fmt: skip
    log = (toy.folder / "slurm.log").open("w+")
    with log, subprocess.Popen(command, cwd=toy.folder, env=environment, stderr=log) as build:
        try:
            killed = kill_first_chunk(slurm, build)
            build.wait(240)
        finally:
            build.kill()
            log.seek(0)
            reported = log.read()
            print(reported)
    assert build.returncode == 0, reported
    assert f"'{killed}' failed, SLURM status is: 'CANCELLED'" in reported
    assert chunks(toy) == ["0-19", "20-39"]
    assert (toy.folder / ROBUSTNESS).read_bytes() == in_one
    for name in ("toy/table1.csv", "toy/fig1.svg", "toy/sensitivity.svg", "report.html"):
        assert (toy.folder / "results" / name).is_file()
    states = ask(slurm, "squeue", "--noheader", "--states=all", "--format=%T").split()
    assert sorted(states) == ["CANCELLED", *5 * ["COMPLETED"]]


def kill_first_chunk(slurm: dict[str, str], build: subprocess.Popen[bytes]) -> str:
    """Wait for a chunk to run and cancel it; returns its Slurm job."""
    while build.poll() is None:
        rows = ask(slurm, "squeue", "--noheader", "--states=RUNNING", "--format=%i %k")
        for row in rows.splitlines():
            number, _, comment = row.partition(" ")
            if "sample" in comment:
                ask(slurm, "scancel", number)
                return number
        time.sleep(0.2)
    raise AssertionError("no chunk ran")
