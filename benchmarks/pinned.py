"""What pinned code paths cost: a paper evaluated with them, and as the processor would have it."""

from __future__ import annotations

import statistics
import time
from pathlib import Path

from benchmarks.report import Row, Section
from reobserve.core.code_paths import ENABLED, KERNEL
from reobserve.core.errors import ReobserveError
from reobserve_papers.golden.conditions import FREE, evaluate

_PAPERS = ("ilo", "lie", "eso")
_SETTINGS = {"pinned": {KERNEL: "Nehalem", ENABLED: " "}, "as the processor would have it": FREE}


def run(quick: bool) -> Section:
    """Evaluate everything of some papers in fresh processes, both ways in turns."""
    rounds = 1 if quick else 3
    section = Section(
        "Evaluation with pinned code paths",
        f"a fresh process, imports included: median of {rounds} rounds after an untimed one, "
        "peers in turns; cost is our time over the peer's",
    )
    project = Path(__file__).parents[1]
    for paper in _PAPERS:
        times: dict[str, list[float]] = {name: [] for name in _SETTINGS}
        try:
            for number in range(rounds + 1):
                for name, variables in _SETTINGS.items():
                    start = time.monotonic()
                    evaluate(project, paper, variables)
                    times[name] += [time.monotonic() - start] if number else []
        except ReobserveError as error:
            section.notes.append(f"{paper}: {error}")
            continue
        (_, pinned), (peer, free) = (
            (name, statistics.median(all_)) for name, all_ in times.items()
        )
        section.rows.append(Row(f"all of {paper}, pinned", pinned, peer, free, cost=True))
    return section
