"""Evaluations under other settings, each in a process of its own, from which tolerances follow.

numpy, its BLAS, the compiler of the loops and the C library choose machine code by the processor
that they find, and take other choices from the environment before they start. A rounding error in
the measurements stands in for processors that cannot be emulated.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from reobserve.core.code_paths import ENABLED, KERNEL, THREADS, unpinned
from reobserve.core.errors import ReobserveError
from reobserve_papers.golden.number_files import Numbers, read_numbers, write_numbers
from reobserve_papers.golden.values import evaluated_numbers, part_names
from reobserve_papers.parameters.parameters import default_parameters
from reobserve_papers.signals.series import Channel
from reobserve_papers.steps.evaluation import Evaluator

# Another order of sets, and every library as it likes best on this processor.
FREE = {"PYTHONHASHSEED": "1"}

# No vector instructions beyond those of every x86-64 processor, and no fused multiply-adds.
_OLD = {
    KERNEL: "Prescott",
    ENABLED: " ",
    "NUMBA_CPU_NAME": "generic",
    "NUMBA_CPU_FEATURES": "",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2",
}
_X86 = platform.machine().lower() in ("x86_64", "amd64")
_ROUNDED, _HALVED = "rounded", "halved"


def measure(project: Path, paper: str, cores: int) -> list[dict[str, Numbers]]:
    """The numbers of a paper by part: as on other processors, and last with every step halved."""
    settings = [(FREE, ""), *([(_OLD, "")] if _X86 else []), (None, _ROUNDED), (None, _HALVED)]
    with ThreadPoolExecutor(cores) as pool:
        return list(pool.map(lambda setting: evaluate(project, paper, *setting), settings))


def evaluate(
    project: Path, paper: str, variables: Mapping[str, str] | None = None, change: str = ""
) -> dict[str, Numbers]:
    """The numbers of a paper under these variables, or those of this process for None."""
    environment = dict(os.environ)
    if variables is not None:
        environment = unpinned(environment) | dict.fromkeys(THREADS, "1") | dict(variables)
    with tempfile.TemporaryDirectory(prefix="reobserve-") as folder:
        command = [sys.executable, "-m", __name__, str(project), paper, folder, change]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            said = done.stderr.strip().splitlines() or [f": exit code {done.returncode}"]
            raise ReobserveError(f"{paper}: {said[-1].partition(': ')[2]}")
        return {path.stem: read_numbers(path) for path in Path(folder).glob("*.csv")}


class Rounded(Evaluator):
    """An evaluator that moves the plants' records by one unit in the last place, up or down."""

    def run(self, step: str, *names: str) -> Any:
        """Compute a step, in which round numbers of a plant, such as modes, stay exact."""
        record = super().run(step, *names)
        if step != "plant":
            return record
        random, channels = np.random.default_rng(0), {}
        for name, channel in record.channels.items():
            values, way = channel.values, random.choice([-np.inf, np.inf], channel.values.shape)
            moved = np.where(values == np.round(values), values, np.nextafter(values, way))
            channels[name] = Channel(moved, channel.unit)
        return replace(record, channels=channels)


def main(project: str, paper: str, folder: str, change: str) -> None:
    """Evaluate a paper and write a file for each part to a folder."""
    parameters = default_parameters(Path(project), paper)
    kind = Rounded if change == _ROUNDED else Evaluator
    evaluator = kind(parameters.refined() if change == _HALVED else parameters)
    for part in part_names(parameters.tree):
        write_numbers(Path(folder) / f"{part}.csv", evaluated_numbers(evaluator, part))


if __name__ == "__main__":
    main(*sys.argv[1:])
