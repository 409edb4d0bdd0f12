"""CPU and wall seconds of filters over many records in one process, printed as JSON.

It is given the folder of the compiled peers. The machine code of ours is read from the cache.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.kalman_problem import (
    NAMES,
    Array,
    Found,
    Jobs,
    c_filter,
    libraries,
    linear_model,
    our_filter,
    records,
    ring,
    ring_jacobian,
)
from reobserve import InputError

RECORDS, ROWS = 1_000, 1_000
CASES = {"KF": 4, "EKF": 2}  # and the numbers of states


def cases(folder: Path, count: int = RECORDS) -> Iterator[tuple[str, Jobs]]:
    """What is measured: the label, and the jobs that do the same."""
    for kind, n in CASES.items():
        yield f"{kind}, n = {n}", batch_jobs(folder, kind, n, *records(n, ROWS, count))


def batch_jobs(folder: Path, kind: str, n: int, y: Array, u: Array) -> Jobs:
    """Ours over records one by one, and over all in one call where it takes them; the peers."""
    ours = our_filter(kind, n)
    start = ours.init(np.zeros(n), 1.0)

    def one_by_one() -> list[Any]:
        return [ours.run(one, u_, start=start) for one, u_ in zip(y, u, strict=True)]

    def at_once() -> Any:
        return ours.run(y, u, start=start)

    jobs: dict[str, Callable[[], Any]] = {"runs in a list": one_by_one}
    try:
        ours.run(y[:2], u[:2], start=start)
    except InputError:
        pass
    else:
        jobs["run of the array"] = at_once
    peers = libraries(folder, n).items()
    jobs |= {name: c_filter(one, kind, n, y, u) for name, one in peers}
    return jobs | {"numpy": lambda: by_numpy(kind, n, y, u)}


def arrays(job: Callable[[], Any]) -> Found:
    """What a job finds, as arrays over all records."""
    found = job()
    if isinstance(found, list):
        return tuple(np.array([run[name] for run in found]) for name in NAMES)
    return found if isinstance(found, tuple) else tuple(found[name] for name in NAMES)


def by_numpy(kind: str, n: int, y: Array, u: Array) -> Found:
    """As it would be written in numpy: the records side by side, no loop but over time."""
    A, B, C, D, Q, R = linear_model(n).arrays
    count, rows = y.shape[:2]
    shapes = ((n,), (n, n), (1,), (1, 1), ())
    found = tuple(np.empty((count, rows, *shape)) for shape in shapes)
    x, P, identity = np.zeros((count, n)), np.tile(np.eye(n), (count, 1, 1)), np.eye(n)
    for k in range(rows):
        if k > 0 and kind == "KF":
            x, P = x @ A.T + u[:, k - 1] @ B.T, A @ P @ A.T + Q
        elif k > 0:
            F = ring_jacobian(x)
            x, P = ring(x, u[:, k - 1]), F @ P @ F.transpose(0, 2, 1) + Q
        e = y[:, k] - x @ C.T - u[:, k] @ D.T
        cross = P @ C.T
        S = C @ cross + R
        inverse = np.linalg.inv(S)
        K = cross @ inverse
        x = x + np.einsum("cao,co->ca", K, e)
        rest = identity - K @ C
        P = rest @ P @ rest.transpose(0, 2, 1) + K @ R @ K.transpose(0, 2, 1)
        distance = np.einsum("co,cop,cp->c", e, inverse, e)
        log_likelihood = -0.5 * (distance + np.linalg.slogdet(2.0 * np.pi * S)[1])
        for place, value in zip(found, (x, P, e, S, log_likelihood), strict=True):
            place[:, k] = value
    return found


def main(folder: Path) -> None:
    """Time all cases once each, after a round that is not timed."""
    times: dict[str, dict[str, tuple[float, float]]] = {}
    for label, jobs in cases(folder):
        for job in jobs.values():
            job()
        times[label] = {name: _timed(job) for name, job in jobs.items()}
    print(json.dumps(times))


def _timed(job: Callable[[], object]) -> tuple[float, float]:
    wall, cpu = time.perf_counter(), time.process_time()
    found = job()
    taken = time.process_time() - cpu, time.perf_counter() - wall
    del found
    return taken


if __name__ == "__main__":
    main(Path(sys.argv[1]))
