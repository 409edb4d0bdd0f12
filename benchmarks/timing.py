"""Fair timing: peers take turns, so that a busy moment of the machine hits all of them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from statistics import median
from typing import Any


def interleaved(jobs: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, float]:
    """The best time [s] of each job in ``repeats`` rounds; one untimed round comes first.

    The best and not the mean: what else runs on the machine only ever adds time.
    """
    return {name: min(times) for name, times in _rounds(jobs, repeats).items()}


def medians(
    jobs: Mapping[str, Callable[[], object]],
    repeats: int,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, float]:
    """The median time [s] of each job by a clock, in rounds as those of `interleaved`."""
    return {name: median(times) for name, times in _rounds(jobs, repeats, clock).items()}


def _rounds(
    jobs: Mapping[str, Callable[[], object]],
    repeats: int,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, list[float]]:
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for job in jobs.values():
        job()
    for _ in range(repeats):
        for name, job in jobs.items():
            start = clock()
            job()
            times[name].append(clock() - start)
    return times


def first_call(module: str, cache: str) -> float:
    """The time [s] that a module prints in a fresh process whose numba cache is a folder."""
    return float(printed(module, NUMBA_CACHE_DIR=cache))


def printed(module: str, *arguments: str, **environment: str) -> Any:
    """What a module prints as JSON in a fresh process."""
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments],
        cwd=Path(__file__).parents[1],
        env={**os.environ, **environment},
        check=True,
        capture_output=True,
        text=True,
    )
    return json.loads(done.stdout)
