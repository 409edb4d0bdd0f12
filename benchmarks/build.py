"""The cold build of all figures against the same jobs doing nothing but their imports."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from statistics import mean

from benchmarks.project_copy import Build, BuildError, ProjectCopy
from benchmarks.report import Check, Row, Section

_AIM = 1.5
_FLOOR = "imports only"


def run(quick: bool) -> Section:
    """Build in a temporary copy: to fill the caches, then for real and as imports in turns."""
    rounds = 1 if quick else 2
    section = Section(
        "Cold build of all figures on 2 cores",
        f"best of {rounds} rounds, peers in turns; cost is our time over the peer's",
    )
    try:
        with tempfile.TemporaryDirectory() as folder:
            _measure(section, ProjectCopy(Path(folder)), rounds)
    except (OSError, subprocess.CalledProcessError) as error:
        section.notes.append(f"skipped, the project cannot be copied with git: {error}")
    except BuildError as error:
        section.checks.append(Check("build in the copy, failures", 1, 0))
        section.notes.append(f"the build failed:\n{error}")
    return section


def _measure(section: Section, copy: ProjectCopy, rounds: int) -> None:
    # The first build fills the caches, the second takes notes, too: what a job imports with a
    # warm cache is what the floor has to import.
    empty = [copy.build("numba")]
    copy.keep()
    copy.build("numba", "record_job.py")
    differing = copy.differing()
    stages = {stage: len(times) for stage, times in empty[0].stages.items()}
    jobs = sum(stages.values())
    if len(list(copy.notes.iterdir())) != jobs:
        section.notes.append("skipped: the shell of the jobs does not take a stand-in (not bash?)")
        return
    real, floor = [], []
    for number in range(rounds):
        if number > 0:
            empty.append(copy.build(f"numba_{number}"))
        real.append(copy.build("numba"))
        differing += copy.differing()
        floor.append(copy.build("numba", "import_job.py"))

    warm, cold, bare = _best(real), _best(empty), _best(floor)
    section.rows = [
        Row("build, numba cache warm", warm[0], _FLOOR, bare[0], cost=True, aim=_AIM),
        Row("build, numba cache empty", cold[0], _FLOOR, bare[0], cost=True),
        Row("processor time, cache warm", warm[1], _FLOOR, bare[1], cost=True, aim=_AIM),
        Row("processor time, cache empty", cold[1], _FLOOR, bare[1], cost=True),
    ]
    section.rows += [
        Row(
            f"{stage}, one of {count}",
            _stage(real, stage),
            _FLOOR,
            _stage(floor, stage),
            cost=True,
        )
        for stage, count in stages.items()
    ]
    section.checks.append(
        Check("files that differ between builds", len(set(differing)), tolerance=0)
    )
    section.notes += [
        f"{jobs} jobs; the floor runs the same workflow and imports, job by job, what the real "
        "job had imported at its end",
        "where other programs run at the same time, processor time is the one to believe",
        "a stage is the mean over its jobs, cache warm, in the round where that is least",
    ]


def _best(builds: list[Build]) -> tuple[float, float]:
    """The least time on the clock and of the processor."""
    return min(build.wall for build in builds), min(build.processor for build in builds)


def _stage(builds: list[Build], stage: str) -> float:
    """The mean time of a stage's jobs, in the round where it is least."""
    return min(mean(build.stages[stage]) for build in builds)
