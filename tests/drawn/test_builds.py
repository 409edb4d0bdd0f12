"""Builds under faults: after each of them a build ends with the bytes of an undisturbed one."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
import time
from itertools import product
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as some

from tests.reobserve_papers.pipeline.conftest import Project, copy_toy

from . import times

pytestmark = pytest.mark.nightly

TARGET = "figures"
IS_ROOT = os.geteuid() == 0
# Without the rights by which root writes what others may not.
AS_A_USER = "setpriv --bounding-set=-dac_override,-dac_read_search,-fowner " * IS_ROOT
PLACES = (
    "results", "logs/toy", "results/toy", ".snakemake/metadata", "results/toy/push", ".snakemake",
    "logs/toy/table1.table.log", "results/toy/parameters.json", "results/toy/table1.csv",
)  # fmt: skip
OWNERS = ["read-only", *["another owner"] * IS_ROOT]
# What happens, and how many results there are before, or how large files may become [KB], or by how
# many days clocks are wrong, or which result or place it happens to.
FAULTS = some.one_of(
    some.tuples(some.just("kill"), some.integers(1, 12)),
    some.tuples(some.just("full disk"), some.integers(0, 64)),
    some.tuples(some.just("clock"), some.integers(-400, 400)),
    some.tuples(some.sampled_from(OWNERS), some.sampled_from(PLACES)),
    some.tuples(some.just("cut"), some.integers(0, 12)),
    some.tuples(some.just("two at once"), some.just(0)),
)
EACH = [
    ("kill", 3), ("full disk", 4), ("clock", -1), ("cut", 2), ("kill", 8), ("clock", 1),
    ("two at once", 0), *product(OWNERS, PLACES[2::3]),
]  # fmt: skip


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Project:
    project = copy_toy(tmp_path_factory.mktemp("undisturbed") / "toy")
    project.snakemake(TARGET)
    return project


def started(project: Project, most: int = 0) -> subprocess.Popen[bytes]:
    """A build, in which files may have ``most`` KB."""
    limit = f"trap '' XFSZ; ulimit -f {most}; " if most else ""
    return subprocess.Popen(
        ["bash", "-c", f"{limit}exec snakemake --cores 1 {TARGET}"],
        cwd=project.folder, env=project.environment, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def happen(project: Project, fault: str, size: Any) -> None:
    """One fault, with what a user does after it."""
    if fault in ("read-only", "another owner"):
        hindered(project, fault, size)
    elif fault == "kill":
        build = started(project)
        while build.poll() is None and len(project.results()) < size:
            time.sleep(0.02)
        if build.poll() is None:
            os.killpg(build.pid, signal.SIGKILL)
        build.wait()
    elif fault == "full disk":
        started(project, 1 + size).wait()
    elif fault == "two at once":
        first = started(project)
        time.sleep(1.0)  # so that they do not lock the folder in the same instant
        second = started(project)
        assert 0 in (first.wait(), second.wait())
    elif results := sorted(project.folder.glob("results/**/*.*")):
        path = results[size % len(results)]
        if fault == "clock":
            os.utime(path, (time.time() + 86_400.0 * size,) * 2)
        else:
            path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    project.run("snakemake", "--unlock", check=False)


def hindered(project: Project, fault: str, name: str) -> None:
    """A build of everything where a file or folder cannot be written, which it names if it ends."""
    started(project).wait()
    place = project.folder / name
    about = place.stat()
    if fault == "read-only":
        place.chmod(about.st_mode & ~0o222)
    else:
        os.chown(place, 65_534, 65_534)  # nobody
    line = f"{AS_A_USER}snakemake --cores 1 --forceall {TARGET}"
    done = project.run(*line.split(), check=False)
    os.chown(place, about.st_uid, about.st_gid)
    place.chmod(about.st_mode)
    said = done.stdout + done.stderr
    assert 'File "' not in said, said  # as in a traceback
    assert done.returncode == 0 or name in said, said


def check(undisturbed: Project, faults: list[tuple[str, Any]]) -> None:
    """Compare a build after faults with the undisturbed one."""
    wanted = undisturbed.results()
    with tempfile.TemporaryDirectory() as folder:
        project = copy_toy(Path(folder) / "toy")
        cache = "src/reobserve/__pycache__"
        shutil.copytree(undisturbed.folder / cache, project.folder / cache, dirs_exist_ok=True)
        for fault, size in faults:
            happen(project, fault, size)
        done = project.snakemake(TARGET, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        found = project.results()
        assert sorted(found) == sorted(wanted)
        assert [name for name in found if found[name] != wanted[name]] == []


@given(some.lists(FAULTS, min_size=1, max_size=3))
@example(EACH)
@times(1 / 100)
def test_build_after_faults_has_the_bytes_of_an_undisturbed_one(
    undisturbed: Project, faults: list[tuple[str, Any]]
) -> None:
    check(undisturbed, faults)
