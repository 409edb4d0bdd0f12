"""What pinned code paths cost: a paper evaluated with them, and as the processor would have it."""

from __future__ import annotations

import statistics
from pathlib import Path

from benchmarks.report import Row, Section
from reobserve.errors import ReobserveError
from reobserve.evidence.golden.processors import PINNED, processors
from reobserve.evidence.golden.runs import run_all

_PAPERS = ("ilo", "lie", "eso")
_FREE = processors()[0]


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
        times: dict[str, list[float]] = {PINNED.name: [], _FREE.name: []}
        try:
            for number in range(rounds + 1):
                for done in run_all(project, {paper: None}, [PINNED, _FREE], cores=1):
                    times[done.condition.name] += [done.seconds] if number else []
        except ReobserveError as error:
            section.notes.append(f"{paper}: {error}")
            continue
        pinned, free = (statistics.median(found) for found in times.values())
        section.rows.append(Row(f"all of {paper}, pinned", pinned, _FREE.name, free, cost=True))
    return section
