"""Builds from nothing against one process that computes and draws the same in memory."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import mean

from benchmarks.project_copy import Build, BuildError, ProjectCopy
from benchmarks.report import Check, Row, Section

_IN_MEMORY = "one process in memory"
_ONE = ("ilo", "fig1")
_MOST_CPU = 2.0

# Seconds on two quiet cores that a user is asked to wait at most.
_FIGURES, _WARM, _FIGURE, _EVIDENCE = 90.0, 60.0, 10.0, 60.0


def run(quick: bool) -> Section:
    """Build in a temporary copy, with compiled loops and without, all and one figure."""
    rounds = 1 if quick else 2
    section = Section(
        "Builds from nothing on 2 cores",
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
    target = f"results/{_ONE[0]}/{_ONE[1]}.pdf"
    script = [sys.executable, "-m", "benchmarks.in_memory"]
    cold, cold_peer, one, one_peer, warm, warm_peer = ([] for _ in range(6))
    differing: list[str] = []
    for number in range(rounds):
        cold.append(copy.build(f"cold_{number}", ["figures"]))
        if number:
            differing += copy.differing()
        else:
            copy.keep()
        cold_peer.append(copy.run(f"peer_{number}", script))
        one.append(copy.build(f"one_{number}", [target]))
        one_peer.append(copy.run(f"one_peer_{number}", [*script, *_ONE]))
        warm.append(copy.build("cold_0", ["figures"]))
        differing += copy.differing()
        warm_peer.append(copy.run("cold_0", script))
    whole = copy.build("cold_0", [])
    section.rows = [
        *_rows("figures, caches empty", cold, cold_peer, _FIGURES),
        *_rows("figures, loops compiled", warm, warm_peer, _WARM),
        *_rows(f"{target} alone, caches empty", one, one_peer, _FIGURE),
        Row(
            "the evidence beside them", whole.wall - _least(warm, "wall"), "limit", _EVIDENCE,
            cost=True, aim=1.0,
        ),
        *(
            Row(f"{stage}, one of {len(times)}", mean(times), "limit", 10.0, cost=True)
            for stage, times in whole.stages.items()
        ),
    ]  # fmt: skip
    section.checks.append(
        Check("files that differ between builds", len(set(differing)), tolerance=0)
    )
    section.notes += [
        "limits are what a user is asked to wait at most, on two quiet cores",
        "where other programs run at the same time, processor time is the one to believe",
        "a stage is the mean on the clock over its jobs in a whole build, loops compiled",
    ]


def _rows(what: str, ours: Sequence[Build], peer: Sequence[Build], limit: float) -> list[Row]:
    wall, processor = _least(ours, "wall"), _least(ours, "processor")
    peer_time = _least(peer, "processor")
    return [
        Row(what, wall, "limit", limit, cost=True, aim=1.0),
        Row("  processor time", processor, _IN_MEMORY, peer_time, cost=True, aim=_MOST_CPU),
    ]


def _least(builds: Sequence[Build], time: str) -> float:
    return min(float(getattr(build, time)) for build in builds)
