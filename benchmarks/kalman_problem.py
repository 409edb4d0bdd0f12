"""A damped ring of any number of states, its records, and filters for it: ours and those in C.

    x_i(k+1) = x_i + T (sin(x_(i+1)) - x_i),   y = x_0

The input drives the last state. The linear model is that at zero.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import reobserve
from benchmarks.compiled import build_c, pointer
from reobserve.observers import kalman
from reobserve_papers.signals.random_streams import random_stream

Array = NDArray[np.float64]
Found = tuple[Array, ...]
Jobs = dict[str, Callable[[], Found]]

PERIOD = 0.05
NAMES = ("state", "covariance", "innovation", "innovation_covariance", "log_likelihood")
ROLLED = "loops of all sizes"
FILTERS = {"KF": "linear", "EKF": "extended", "UKF": "unscented"}  # with their names in C
_PROCESS, _MEASUREMENT = 1e-4, 1e-2


def ring(x: Array, u: Array) -> Array:
    """The next state, for any number of records: shapes (..., n) and (..., 1)."""
    after = x + PERIOD * (np.sin(np.roll(x, -1, axis=-1)) - x)
    after[..., -1] += PERIOD * u[..., 0]
    return after


def ring_jacobian(x: Array) -> Array:
    """The Jacobian of `ring`, shape (..., n, n)."""
    identity = np.eye(x.shape[-1])
    slopes = np.cos(np.roll(x, -1, axis=-1))[..., np.newaxis]
    return (1.0 - PERIOD) * identity + PERIOD * slopes * np.roll(identity, 1, axis=1)


def linear_model(n: int) -> reobserve.LinearModel:
    """The ring as it is at zero."""
    A, identity = ring_jacobian(np.zeros(n)), np.eye(n)
    B, C = PERIOD * identity[:, -1:], identity[:1]
    return reobserve.LinearModel(A, B, C, Q=_PROCESS, R=_MEASUREMENT, sampling_period=PERIOD)


@cache
def nonlinear_model(n: int) -> reobserve.NonlinearModel:
    """The ring as texts."""
    f = [f"x{i} + {PERIOD}*(sin(x{(i + 1) % n}) - x{i})" for i in range(n)]
    f[-1] += f" + {PERIOD}*u"
    return reobserve.NonlinearModel(
        f, ["x0"], _PROCESS, _MEASUREMENT, state_names=[f"x{i}" for i in range(n)],
        input_names=["u"], sampling_period=PERIOD,
    )  # fmt: skip


def our_filter(kind: str, n: int) -> Any:
    """A filter by its name in `FILTERS`."""
    if kind == "KF":
        return reobserve.KalmanFilter(linear_model(n))
    if kind == "EKF":
        return reobserve.ExtendedKalmanFilter(nonlinear_model(n))
    return reobserve.UnscentedKalmanFilter(nonlinear_model(n))


def records(n: int, rows: int, count: int) -> tuple[Array, Array]:
    """Measurements and inputs of many records, shapes (count, rows, 1)."""
    stream = random_stream(0, "benchmark", "kalman", str(n))
    u = stream.standard_normal((count, rows, 1))
    y = np.sqrt(_MEASUREMENT) * stream.standard_normal((count, rows, 1))
    x = stream.standard_normal((count, n))
    for k in range(rows):
        y[:, k, 0] += x[:, 0]
        x = ring(x, u[:, k]) + np.sqrt(_PROCESS) * stream.standard_normal((count, n))
    return y, u


def build(folder: Path, n: int, flags: tuple[str, ...]) -> str | None:
    """Compile the peers of n states into a folder; the command, or None if that fails."""
    sizes = (f"-DN={n}", "-DM=1", "-DP=1")
    return build_c("kalman.c", (*flags, *sizes), folder / f"{n} C {' '.join(flags)}.so")


def libraries(folder: Path, n: int) -> dict[str, ctypes.CDLL]:
    """What `build` left there for n states, by how it was compiled."""
    found = sorted(path.stem for path in folder.glob(f"{n} *.so"))
    return {stem.partition(" ")[2]: ctypes.CDLL(str(folder / f"{stem}.so")) for stem in found}


def c_constants(n: int) -> tuple[Array, Array, Array]:
    """The model, the weights of sigma points and the start (zero, covariance 1) as C reads them."""
    model = np.concatenate([part.ravel() for part in linear_model(n).arrays])
    square = 0.01 * n  # alpha = 0.1, beta = 2, kappa = 0
    weights = np.array([np.sqrt(square), 0.5 / square, (square - n) / square + 1.0 - 0.01 + 2.0])
    return model, weights, np.concatenate([np.zeros(n), np.eye(n).ravel()])


def c_filter(library: ctypes.CDLL, kind: str, n: int, y: Array, u: Array) -> Callable[[], Found]:
    """The run of a filter over records, shapes (count, rows, 1), or over one, (rows, 1)."""
    function, rows = library[FILTERS[kind]], y.shape[-2]
    function.restype = ctypes.c_long
    shapes = ((n,), (n, n), (1,), (1, 1), ())
    found = tuple(np.zeros((*y.shape[:-1], *shape)) for shape in shapes)
    first = [pointer(one) for one in c_constants(n)]
    many = [one.reshape(-1, *one.shape[y.ndim - 2 :]) for one in (y, u, *found)]
    calls = [
        (*first, pointer(y_), pointer(u_), ctypes.c_long(rows), *map(pointer, out))
        for y_, u_, *out in zip(*many, strict=True)
    ]

    def call() -> Found:
        for arguments in calls:
            function(*arguments)
        return found

    return call


def c_smoother(library: ctypes.CDLL, kind: str, n: int, run: Any, u: Array) -> Callable[[], Found]:
    """The smoother over a run."""
    function = library[f"smooth_{FILTERS[kind]}"]
    function.restype = ctypes.c_long
    given, found = [c_constants(n)[0], u], (np.zeros((len(u), n)), np.zeros((len(u), n, n)))
    filtered = [np.ascontiguousarray(run[name]) for name in NAMES[:2]]
    rows = ctypes.c_long(len(u))

    def call() -> Found:
        function(*map(pointer, given), rows, *map(pointer, (*filtered, *found)))
        return found

    return call


def filter_jobs(folder: Path, kind: str, n: int, rows: int) -> Jobs:
    """A run of a filter, as ``ours``, and that of the peers."""
    y, u = (one[0] for one in records(n, rows, 1))
    ours = our_filter(kind, n)
    start = ours.init(np.zeros(n), 1.0)

    def run() -> Found:
        done = ours.run(y, u, start=start)
        return tuple(done[name] for name in NAMES)

    peers = libraries(folder, n).items()
    jobs = {"ours": run, **{name: c_filter(one, kind, n, y, u) for name, one in peers}}
    if n <= kalman.UNROLLED:
        jobs[ROLLED] = rolled(kind, n, y, u)
    return jobs


def rolled(kind: str, n: int, y: Array, u: Array) -> Callable[[], Found]:
    """A run of our filter by the loops that are compiled for all sizes."""
    one, unrolled = our_filter(kind, n), kalman.UNROLLED
    start = one.init(np.zeros(n), 1.0)
    kalman.UNROLLED = 0  # scratch, which the filter keeps, says by which loops it is run
    try:
        one.run(y[:1], u[:1], start=start)
    finally:
        kalman.UNROLLED = unrolled

    def run() -> Found:
        done = one.run(y, u, start=start)
        return tuple(done[name] for name in NAMES)

    return run


def smoother_jobs(folder: Path, kind: str, n: int, rows: int) -> Jobs:
    """The smoother over a run of a filter, as ``ours``, and that of the peers."""
    y, u = (one[0] for one in records(n, rows, 1))
    ours = our_filter(kind, n)
    done = ours.run(y, u, start=ours.init(np.zeros(n), 1.0))

    def smooth() -> Found:
        found = reobserve.rts_smoother(done)
        return found["state"], found["covariance"]

    peers = libraries(folder, n).items()
    return {"ours": smooth, **{name: c_smoother(one, kind, n, done, u) for name, one in peers}}
