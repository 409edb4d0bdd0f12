"""Evaluations under other settings, each in a process of its own, from which tolerances follow.

numpy, its BLAS, the compiler of the loops and the C library choose machine code by the processor
that they find, and take other choices from the environment before they start.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from reobserve.errors import ReobserveError
from reobserve.evidence.golden.files import Numbers, read_numbers, write_numbers
from reobserve.evidence.golden.values import evaluated_numbers, part_names
from reobserve.ledger.ledger import default_ledger
from reobserve.numerics.code_paths import ENABLED, KERNEL, THREADS, unpinned
from reobserve.replication.evaluation import Evaluator

_HALVED = "halved"

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
PROCESSORS: tuple[Mapping[str, str], ...] = (FREE, _OLD) if _X86 else (FREE,)


def measure(
    project: Path, paper: str, cores: int
) -> tuple[list[dict[str, Numbers]], dict[str, Numbers]]:
    """The numbers of a paper by part: on each of `PROCESSORS`, and with every step halved."""
    with ThreadPoolExecutor(cores) as pool:
        settings = [*PROCESSORS, None]
        *processors, halved = pool.map(lambda one: evaluate(project, paper, one), settings)
    return processors, halved


def evaluate(project: Path, paper: str, variables: Mapping[str, str] | None) -> dict[str, Numbers]:
    """The numbers of a paper under these variables, or with every step halved for None."""
    environment = dict(os.environ)
    if variables is not None:
        environment = unpinned(environment) | dict.fromkeys(THREADS, "1") | dict(variables)
    with tempfile.TemporaryDirectory(prefix="reobserve-") as folder:
        command = [sys.executable, "-m", __name__, str(project), paper, folder]
        command += [_HALVED] if variables is None else []
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            said = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
            raise ReobserveError(f"{paper}: {said[-1].removeprefix('reobserve: ')}")
        return {path.stem: read_numbers(path) for path in Path(folder).glob("*.csv")}


def main(project: str, paper: str, folder: str, steps: str = "") -> int:
    """Evaluate a paper and write a file for each part to a folder; 1 on an error."""
    try:
        ledger = default_ledger(Path(project), paper)
        evaluator = Evaluator(ledger.refined() if steps == _HALVED else ledger)
        for part in part_names(ledger.tree):
            write_numbers(Path(folder) / f"{part}.csv", evaluated_numbers(evaluator, part))
    except ReobserveError as error:
        print(f"reobserve: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
