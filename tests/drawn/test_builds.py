"""Builds under faults: after each of them a build ends with the bytes of an undisturbed one."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as some

from tests.reobserve_papers.pipeline.conftest import Project, copy_toy

from . import fewer

pytestmark = pytest.mark.nightly

TARGET = "figures"
DAY = 86_400.0  # s
# What happens, and how many results there are before, or how large files may become [KB], or by how
# many days clocks are wrong, or which result it happens to.
FAULTS = some.one_of(
    some.tuples(some.just("kill"), some.integers(1, 12)),
    some.tuples(some.just("full disk"), some.integers(0, 64)),
    some.tuples(some.just("clock"), some.integers(-400, 400)),
    some.tuples(some.just("read-only"), some.integers(0, 12)),
    some.tuples(some.just("cut"), some.integers(0, 12)),
    some.tuples(some.just("two at once"), some.just(0)),
)
EACH = [
    ("kill", 3), ("full disk", 4), ("clock", -1), ("cut", 2), ("read-only", 0), ("kill", 8),
    ("clock", 1), ("two at once", 0),
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


def happen(project: Project, fault: str, size: int) -> None:
    """One fault, with what a user does after it."""
    results = [path for path in (project.folder / "results").rglob("*.*") if path.is_file()]
    chosen = sorted(results)[size % max(len(results), 1) :][:1]
    if fault == "kill":
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
    for path in chosen:
        if fault == "clock":
            os.utime(path, (time.time() + DAY * size,) * 2)
        elif fault == "cut":
            path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        elif fault == "read-only":
            folder, mode = path.parent, path.parent.stat().st_mode
            folder.chmod(0o555)
            try:
                started(project).wait()
            finally:
                folder.chmod(mode)
    project.run("snakemake", "--unlock", check=False)


@given(some.lists(FAULTS, min_size=1, max_size=3))
@example(EACH)
@fewer(100)
def test_build_after_faults_has_the_bytes_of_an_undisturbed_one(
    undisturbed: Project, faults: list[tuple[str, int]]
) -> None:
    wanted = undisturbed.results()
    with tempfile.TemporaryDirectory() as folder:
        project = copy_toy(Path(folder) / "toy")
        compiled = "src/reobserve/__pycache__"
        shutil.copytree(
            undisturbed.folder / compiled, project.folder / compiled, dirs_exist_ok=True
        )
        for fault, size in faults:
            happen(project, fault, size)
        done = project.snakemake(TARGET, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        found = project.results()
        assert sorted(found) == sorted(wanted)
        assert [name for name in found if found[name] != wanted[name]] == []
