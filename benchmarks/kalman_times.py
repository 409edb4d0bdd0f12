"""CPU seconds a row of Kalman filters and smoothers in one process, printed as JSON.

It is given the folder of the compiled peers. The machine code of ours is read from the cache.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.kalman_problem import FILTERS, Jobs, filter_jobs, smoother_jobs
from benchmarks.timing import medians

SIZES, ROWS = (2, 4, 10), 10_000
_ROUNDS = 5


def cases(folder: Path, rows: int = ROWS) -> Iterator[tuple[str, Jobs]]:
    """What is measured: the label, and the jobs that do the same."""
    for n in SIZES:
        for kind in FILTERS:
            yield f"{kind}, n = {n}", filter_jobs(folder, kind, n, rows)
            if kind != "UKF":
                yield f"smoother of {kind}, n = {n}", smoother_jobs(folder, kind, n, rows)


def main(folder: Path) -> None:
    """Time all cases, ours and the peers in turns."""
    found = {
        label: {
            name: time_ / ROWS for name, time_ in medians(jobs, _ROUNDS, time.process_time).items()
        }
        for label, jobs in cases(folder)
    }
    print(json.dumps(found))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
