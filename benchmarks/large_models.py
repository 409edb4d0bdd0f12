"""Kalman filters of many states against numpy, which multiplies by BLAS, filterpy and JAX."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.jax_peer import INSTALLED, by_jax
from benchmarks.kalman_problem import linear_model, records
from benchmarks.report import Check, Row, Section
from benchmarks.timing import medians
from reobserve import IMM, KalmanFilter
from reobserve.observers import kalman
from reobserve.systems.linear import LinearModel

Array = NDArray[np.float64]

_SIZES = {12: 5_000, 20: 2_000, 50: 400, 100: 100, 200: 30}  # and rows
_ROUNDS = 5


def run(quick: bool) -> Section:
    """All sizes."""
    section = Section(
        "Kalman filters of large models: 1 input, 1 output; CPU time of a row",
        f"median of {_ROUNDS} rounds in which peers take turns; speed is the peer's time over ours",
    )
    for n, rows in _SIZES.items():
        model, (y, u) = linear_model(n), (one[0] for one in records(n, rows, 1))
        bank = IMM([KalmanFilter(model)] * 2, [[0.95, 0.05], [0.05, 0.95]])
        start, many = KalmanFilter(model).init(np.zeros(n), 1.0), bank.init(np.zeros(n), 1.0)
        one = KalmanFilter(model)
        jobs: dict[str, Callable[[], Array]] = {
            "ours": partial(by_us, one, start, y, u),
            "plain loops": partial(by_us, by_plain_loops(model), start, y, u),
            "numpy": partial(by_numpy, model, y, u),
            "filterpy": partial(by_filterpy, model, y, u),
            "IMM of two": partial(by_us, bank, many, y, u),
        }
        if INSTALLED:
            jobs["JAX"] = by_jax(model, y, u)
        expected = jobs["ours"]()
        for peer, job in jobs.items():
            difference = float(np.max(np.abs(expected - job())))
            section.checks.append(Check(f"n = {n}, {peer}", difference, 1e-8))
        times = medians(jobs, 2 if quick else _ROUNDS, time.process_time)
        for peer in (name for name in jobs if name not in ("ours", "IMM of two")):
            section.rows.append(Row(f"KF, n = {n}", times["ours"] / rows, peer, times[peer] / rows))
        bank_time = times["IMM of two"] / rows
        section.rows.append(Row(f"IMM of two, n = {n}", bank_time, "one KF", times["ours"] / rows))
    return section


def by_plain_loops(model: LinearModel) -> KalmanFilter:
    """Our filter by the loops of small models."""
    loops: Any = kalman
    one, large = KalmanFilter(model), loops.LARGE
    loops.LARGE = 10**9  # scratch, which the filter keeps, says by which loops it is run
    try:
        zeros = np.zeros((1, 1))
        one.run(zeros, zeros, start=one.init(np.zeros(model.states), 1.0))
    finally:
        loops.LARGE = large
    return one


def by_us(one: Any, start: Any, y: Array, u: Array) -> Array:
    """The estimates of one of our filters."""
    estimates: Array = one.run(y, u, start=start)["state"]
    return estimates


def by_numpy(model: LinearModel, y: Array, u: Array) -> Array:
    """The same filter, as it would be written in numpy."""
    A, B, C, _, Q, R = model.arrays
    n = len(A)
    x, P, identity, estimates = np.zeros(n), np.eye(n), np.eye(n), np.empty((len(y), n))
    for k in range(len(y)):
        if k > 0:
            x, P = A @ x + B @ u[k - 1], A @ P @ A.T + Q
        S = C @ P @ C.T + R
        K = np.linalg.solve(S, C @ P).T
        x = x + K @ (y[k] - C @ x)
        M = identity - K @ C
        P = M @ P @ M.T + K @ R @ K.T
        estimates[k] = x
    return estimates


def by_filterpy(model: LinearModel, y: Array, u: Array) -> Array:
    """The same filter of filterpy."""
    from filterpy.kalman import KalmanFilter as Theirs

    n = model.states
    one = Theirs(n, 1, 1)
    one.F, one.B, one.H, _, one.Q, one.R = model.arrays
    one.x, one.P = np.zeros((n, 1)), np.eye(n)
    estimates = np.empty((len(y), n))
    for k in range(len(y)):
        if k > 0:
            one.predict(u[k - 1][:, None])
        one.update(y[k][:, None])
        estimates[k] = one.x[:, 0]
    return estimates
