"""Filters over many records: one by one, all in one call, in C one by one, and in numpy at once."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from statistics import median

from benchmarks.batch_times import CASES, RECORDS, ROWS, arrays, cases
from benchmarks.kalman import FLAGS, agree
from benchmarks.kalman_problem import build
from benchmarks.report import Row, Section, seconds
from benchmarks.timing import printed

_OURS = ("runs in a list", "run of the array")
_FEW = 20  # records whose results are compared


def run(quick: bool) -> Section:
    """All benchmarks of many records."""
    processes = 3 if quick else 5
    section = Section(
        f"Many records: {RECORDS:,} of {ROWS:,} rows, 1 input, 1 output; times are of all",
        f"median of {processes} fresh processes, in each of which peers take turns; speed is the "
        "peer's time over ours",
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if None in [build(folder, n, FLAGS[0]) for n in CASES.values()]:
            section.notes.append("no C compiler: it is skipped")
        agreeing = {}
        for label, jobs in cases(folder, _FEW):
            found = {name: partial(arrays, job) for name, job in jobs.items()}
            agreeing[label] = agree(section, label, found)
        times = [printed("benchmarks.batch_times", name) for _ in range(processes)]
    for label, others in agreeing.items():
        middle = {
            job: [median(one[label][job][clock] for one in times) for clock in (0, 1)]
            for job in (_OURS[0], *others)
        }
        for ours in _OURS:
            if ours not in middle:
                section.notes.append(f"{label}: run takes no array of records yet: skipped")
                continue
            for peer in (name for name in middle if name not in _OURS):
                section.rows += [
                    Row(f"{label}: {ours}, {clock}", one, peer, other)
                    for clock, one, other in zip(
                        ("CPU", "wall"), middle[ours], middle[peer], strict=True
                    )
                ]
        listed = (f"{job} {seconds(cpu)} ({seconds(wall)})" for job, (cpu, wall) in middle.items())
        section.notes.append(f"{label}, CPU (wall): {', '.join(listed)}")
    return section
