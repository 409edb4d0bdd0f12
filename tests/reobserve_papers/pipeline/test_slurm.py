"""A build as jobs of a single-node Slurm, where one of them is killed."""

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
def on_one_machine(toy: Project) -> bytes:
    """The samples of a build on this machine."""
    toy.snakemake(ROBUSTNESS, "--config", *WHOLE)
    return (toy.folder / ROBUSTNESS).read_bytes()


def test_slurm_profile_lists_exactly_the_existing_rules() -> None:
    profile = read_yaml(ROOT / "profiles/slurm/config.yaml")
    text = "".join(path.read_text() for path in (ROOT / "workflow").rglob("*.smk"))
    alone, grouped = {*profile["set-resources"]}, {*profile["groups"]}
    assert not alone & grouped
    assert alone | grouped | {"search"} == set(re.findall(r"^rule (\w+):", text, re.MULTILINE))


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
    toy: Project, on_one_machine: bytes, slurm: dict[str, str]
) -> None:
    """Slurm jobs: the figures, the samples (twice), and all that comes after them."""
    shutil.rmtree(toy.folder / "results/toy")
    paths = (toy.environment["PYTHONPATH"], str(PLUGIN))
    environment = toy.environment | slurm | {"PYTHONPATH": os.pathsep.join(paths)}
    command = (
        "snakemake", "--profile", "profiles/slurm", "--cores", "2", "--latency-wait", "5",
        "--slurm-no-account", "--slurm-status-command", "squeue",
        "--slurm-init-seconds-before-status-checks", "1", "--seconds-between-status-checks", "3",
        "--config", *WHOLE,
    )  # fmt: skip
    log = (toy.folder / "slurm.log").open("w+")
    with log, subprocess.Popen(command, cwd=toy.folder, env=environment, stderr=log) as build:
        try:
            killed = kill_samples(slurm, build)
            build.wait(240)
        finally:
            build.kill()
            log.seek(0)
            reported = log.read()
            print(reported)
    assert build.returncode == 0, reported
    assert f"'{killed}' failed, SLURM status is: 'CANCELLED'" in reported
    assert (toy.folder / ROBUSTNESS).read_bytes() == on_one_machine
    for name in ("toy/table1.csv", "toy/fig1.svg", "toy/sensitivity.svg", "report.html"):
        assert (toy.folder / "results" / name).is_file()
    states = ask(slurm, "squeue", "--noheader", "--states=all", "--format=%T").split()
    assert sorted(states) == ["CANCELLED", *3 * ["COMPLETED"]]


def kill_samples(slurm: dict[str, str], build: subprocess.Popen[bytes]) -> str:
    """Wait for the job of the samples to run and cancel it; returns its Slurm job."""
    while build.poll() is None:
        rows = ask(slurm, "squeue", "--noheader", "--states=RUNNING", "--format=%i %k")
        for row in rows.splitlines():
            number, _, comment = row.partition(" ")
            if "robustness" in comment:
                ask(slurm, "scancel", number)
                return number
        time.sleep(0.2)
    raise AssertionError("no samples were made")
