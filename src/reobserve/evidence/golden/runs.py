"""Evaluations under several conditions, each in a process of its own, some at a time."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from reobserve.errors import ReobserveError
from reobserve.evidence.golden.kept import KeptPaper
from reobserve.evidence.golden.processors import Condition

# Papers, each with the parts that are evaluated; None for all of them.
Order = Mapping[str, Sequence[str] | None]


@dataclass(frozen=True)
class Run:
    """What was found under a condition, by paper, and how long that took [s]."""

    condition: Condition
    papers: Mapping[str, KeptPaper]
    seconds: float


def run_all(
    project: Path,
    order: Order,
    conditions: Iterable[Condition],
    cores: int,
    done: Callable[[Run], None] = lambda run: None,
) -> list[Run]:
    """Evaluate under each condition, ``cores`` at a time; ``done`` is called after each, in order.

    Raises
    ------
    ReobserveError
        If an evaluation fails; the sentence says under which condition.
    """
    runs = []
    with ThreadPoolExecutor(cores) as pool:
        try:
            for run in pool.map(lambda condition: _run(project, order, condition), conditions):
                done(run)
                runs.append(run)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return runs


def _run(project: Path, order: Order, condition: Condition) -> Run:
    said = json.dumps({"papers": order, "refined": condition.refined, "one_ulp": condition.one_ulp})
    start = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="reobserve-") as folder:
        output = Path(folder) / "found"
        command = [
            sys.executable,
            "-m",
            "reobserve.evidence.golden.job",
            str(project),
            str(output),
            said,
        ]
        ended = subprocess.run(
            command, env=condition.environment(), capture_output=True, text=True, check=False
        )
        if ended.returncode:
            reason = (ended.stderr.strip().splitlines() or [f"exit code {ended.returncode}"])[-1]
            raise ReobserveError(f"{condition.name}: {reason.removeprefix('reobserve: ')}")
        papers = pickle.loads(output.read_bytes())
    return Run(condition, papers, time.monotonic() - start)
