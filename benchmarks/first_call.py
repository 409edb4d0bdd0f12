"""The first run of the continuous ILO in a fresh process: its time, printed in seconds.

Imports are not counted. Whether the machine code is compiled or read depends on the cache, which
the caller chooses by ``NUMBA_CACHE_DIR``.
"""

from __future__ import annotations

import time

from benchmarks.problem import continuous, measured_rate, sampled_record
from reobserve.observers.fixed_step import run_on_halves


def main() -> None:
    """Run one step and print how long that took."""
    observer = continuous()
    record = sampled_record(1)
    state = observer.init(measured_rate(0.0))
    start = time.perf_counter()
    run_on_halves(observer, *record, start=state)
    print(time.perf_counter() - start)


if __name__ == "__main__":
    main()
