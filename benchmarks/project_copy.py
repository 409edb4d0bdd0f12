"""A copy of the project in a temporary folder, and builds in it."""

from __future__ import annotations

import csv
import resource
import shutil
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.project_copy import copy_environment, copy_project

PROJECT = Path(__file__).parents[1]
_MADE = ("results", "logs", ".snakemake")


@dataclass(frozen=True)
class Build:
    """One build from nothing: time on the clock and of the processor [s], and each job's."""

    wall: float
    processor: float
    stages: dict[str, list[float]]


class BuildError(Exception):
    """The build in the copy failed; the message is the end of its output."""


class ProjectCopy:
    """The tracked and the new files of the project, whose package the builds import."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "project"
        self.reference = folder / "reference"
        copy_project(PROJECT, self.folder)

    def build(self, cache: str, targets: Sequence[str]) -> Build:
        """Build these targets with two cores, from nothing but the loops in the ``cache``.

        Raises
        ------
        BuildError
            If the build fails.
        """
        for name in _MADE:
            shutil.rmtree(self.folder / name, ignore_errors=True)
        command = [sys.executable, "-m", "snakemake", "--cores", "2", "--benchmark-extended"]
        return self.run(cache, [*command, *targets])

    def run(self, cache: str, command: Sequence[str]) -> Build:
        """Run a command in the copy, with all processes that it waits for.

        Raises
        ------
        BuildError
            If it fails.
        """
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        done = subprocess.run(
            command, cwd=self.folder, env=self._environment(cache), check=False,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip
        wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
        if done.returncode != 0:
            raise BuildError("\n".join(done.stdout.splitlines()[-15:]))
        processor = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return Build(wall, processor, self._stages())

    def keep(self) -> None:
        """Make what was built the reference: what later builds are compared with and copy."""
        shutil.rmtree(self.reference, ignore_errors=True)
        shutil.copytree(self.folder / "results", self.reference / "results")

    def differing(self) -> list[str]:
        """The files that differ from the reference, or are there or here only."""
        roots = (self.folder / "results", self.reference / "results")
        here, there = (
            {str(p.relative_to(root)): p.read_bytes() for p in root.rglob("*") if p.is_file()}
            for root in roots
        )
        return sorted(name for name in here | there if here.get(name) != there.get(name))

    def _environment(self, cache: str) -> dict[str, str]:
        return copy_environment(self.folder) | {"NUMBA_CACHE_DIR": str(self.folder.parent / cache)}

    def _stages(self) -> dict[str, list[float]]:
        """Seconds of each job by rule, as Snakemake measured them."""
        stages = defaultdict(list)
        for path in sorted(self.folder.glob("logs/**/*.tsv")):
            with path.open(newline="") as stream:
                for job in csv.DictReader(stream, delimiter="\t"):
                    stages[job["rule_name"]].append(float(job["s"]))
        return dict(stages)
