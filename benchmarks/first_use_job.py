"""What the first use of a filter costs in a fresh process, or its later calls; printed as JSON.

Of a first use it is the CPU time [s] of the process so far, imports included. What is compiled
depends on the cache, which the caller chooses by ``NUMBA_CACHE_DIR``.
"""

from __future__ import annotations

import json
import sys
import time

_CALLS, _ROUNDS = 1_000, 5


def imports() -> None:
    """What any first use begins with."""
    import numba  # noqa: F401


def first_run(kind: str) -> None:
    """A run of one row, of a model of two states."""
    import numpy as np

    import reobserve
    from benchmarks.kalman_problem import linear_model, our_filter

    ours = our_filter("KF" if kind == "IMM" else kind, 2)
    if kind == "IMM":
        stays = [[0.95, 0.05], [0.05, 0.95]]
        ours = reobserve.IMM([ours, reobserve.KalmanFilter(linear_model(2))], stays)
    ours.run(np.ones(1), np.ones(1), state=ours.init(np.zeros(2), 1.0))


def later_calls() -> dict[str, float]:
    """CPU seconds of a run of one row, a step, and a step of filterpy, of two states."""
    import numpy as np
    from filterpy.kalman import KalmanFilter

    from benchmarks.kalman_problem import linear_model, our_filter
    from benchmarks.timing import medians

    ours, model = our_filter("KF", 2), linear_model(2)
    state, y, u = ours.init(np.zeros(2), 1.0), np.ones((1, 1)), np.ones((1, 1))
    theirs = KalmanFilter(2, 1, 1)
    theirs.F, theirs.B, theirs.H, _, theirs.Q, theirs.R = model.arrays

    def run() -> None:
        for _ in range(_CALLS):
            ours.run(y, u, state=state)

    def step() -> None:
        latest = state
        for _ in range(_CALLS):
            latest, _ = ours.step(latest, y[0], u[0])

    def filterpy() -> None:
        for _ in range(_CALLS):
            theirs.predict(u)
            theirs.update(y)

    jobs = {"run": run, "step": step, "filterpy": filterpy}
    times = medians(jobs, _ROUNDS, time.process_time)
    return {name: time_ / _CALLS for name, time_ in times.items()}


def main(what: str) -> None:
    """Print what was asked for."""
    if what == "calls":
        print(json.dumps(later_calls()))
        return
    if what == "imports":
        imports()
    else:
        first_run(what)
    print(time.process_time())


if __name__ == "__main__":
    main(sys.argv[1])
