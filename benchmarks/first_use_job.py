"""What the first use of a filter costs in a fresh process, or its later calls; printed as JSON.

Of a first use it is the CPU time [s] of the process so far, imports included. What is compiled
depends on the cache, which the caller chooses by ``NUMBA_CACHE_DIR``.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import Any

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
    ours.run(np.ones(1), np.ones(1), start=ours.init(np.zeros(2), 1.0))


def later_calls() -> dict[str, float]:
    """CPU seconds of a run of one row, of steps, and of steps of filterpy, of two states."""
    import numpy as np
    from filterpy import kalman as theirs

    import reobserve
    from benchmarks.jax_peer import INSTALLED, one_call
    from benchmarks.kalman_problem import linear_model, our_filter, ring, ring_jacobian
    from benchmarks.timing import medians

    model, y, u = linear_model(2), np.ones((1, 1)), np.ones((1, 1))
    stays = np.array([[0.95, 0.05], [0.05, 0.95]])
    bank = reobserve.IMM([our_filter("KF", 2), reobserve.KalmanFilter(model)], stays)
    ours = {"IMM": bank, **{kind: our_filter(kind, 2) for kind in ("KF", "EKF", "UKF")}}
    starts = {kind: one.init(np.zeros(2), 1.0) for kind, one in ours.items()}

    def run() -> None:
        for _ in range(_CALLS):
            ours["KF"].run(y, u, start=starts["KF"])

    def steps(kind: str) -> None:
        latest = starts[kind]
        for _ in range(_CALLS):
            latest, _ = ours[kind].step(latest, y[0], u[0])

    def set_up(one: Any) -> Any:
        one.F, one.B, one.H, _, one.Q, one.R = model.arrays
        return one

    points = theirs.MerweScaledSigmaPoints(2, 0.1, 2.0, 0.0)
    unscented = theirs.UnscentedKalmanFilter(
        2, 1, 1.0, hx=lambda x: x[:1], fx=lambda x, dt, u: ring(x, u), points=points
    )
    unscented.Q, unscented.R = model.Q, model.R
    extended = set_up(theirs.ExtendedKalmanFilter(2, 1, 1))
    alone = set_up(theirs.KalmanFilter(2, 1, 1))
    pair = [set_up(theirs.KalmanFilter(2, 1, 1)) for _ in range(2)]
    peers = {"KF": alone, "IMM": theirs.IMMEstimator(pair, np.full(2, 0.5), stays)}

    def of_peer(kind: str) -> None:
        for _ in range(_CALLS):
            peers[kind].predict(u)
            peers[kind].update(y)

    def of_extended() -> None:
        for _ in range(_CALLS):
            extended.F = ring_jacobian(extended.x[:, 0])
            extended.x = ring(extended.x[:, 0], u[0])[:, None]
            extended.P = extended.F @ extended.P @ extended.F.T + extended.Q
            extended.update(y, lambda _: model.C, lambda x: x[:1])

    def of_unscented() -> None:
        for _ in range(_CALLS // 5):
            unscented.predict(u=u[0])
            unscented.update(y[0])

    jobs: dict[str, Callable[[], None]] = {
        "run": run,
        **{kind: partial(steps, kind) for kind in ours},
    }
    jobs |= {f"filterpy {kind}": partial(of_peer, kind) for kind in peers}
    jobs |= {"filterpy EKF": of_extended, "filterpy UKF": of_unscented}
    if INSTALLED:
        jobs["JAX"] = partial(_repeated, one_call(model))
    times = medians(jobs, _ROUNDS, time.process_time)
    counts = dict.fromkeys(times, _CALLS) | {"filterpy UKF": _CALLS // 5}
    return {name: time_ / counts[name] for name, time_ in times.items()}


def _repeated(call: Callable[[], None]) -> None:
    for _ in range(_CALLS):
        call()


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
