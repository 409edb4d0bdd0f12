"""The extended high-gain observer, whose input comes with its derivatives or alone."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.program import Program, finite, leaves, report, reported
from reobserve.core.errors import InputError
from reobserve.observers.extended_high_gain import (
    SWITCHED,
    ExtendedHighGainObserver,
    ExtendedHighGainState,
    _run,
)
from reobserve.observers.row_derivatives import scaled_weights, write_derivatives

Array = NDArray[Any]


def extended_high_gain(
    observer: ExtendedHighGainObserver, state: ExtendedHighGainState, columns: tuple[int, int]
) -> Program:
    """x^ and tau^, for an input whose derivatives are given, or found from its samples."""
    if observer.initial_matrix is not None:
        raise InputError(
            "observer",
            "with an initial_matrix cannot be exported: its gain is another at each sample until "
            "it has settled",
        )
    model, m, T = observer.model, observer.order, observer.sampling_period
    sample = np.zeros(m + 2) if state.sample is None else state.sample
    begun = 0 if state.sample is None else state.count + 1
    y, u, now = np.empty(1), np.empty(columns[1]), np.empty((1, m + 1))
    memory = {
        "z": state.values.copy(), "y_before": sample[:1].copy(), "u_before": sample[1:].copy(),
        "recent": np.append(state.recent, 0.0), "known": np.array([min(begun, m + 1)]),
    }  # fmt: skip
    z, n = memory["z"], model.states
    table = observer._table(np.zeros(3), np.zeros((3, m + 1)), 0)
    path, off = np.empty((2, n + 1)), np.empty(1)
    weights = scaled_weights(m, T) if len(u) <= m else None
    run = (
        (model.parameters, model.drift, model.input_gain), (0,) * n, m,
        1 + SWITCHED.index(observer.switched), (*observer.delay_bounds, observer.threshold), T,
        table, table, path, off,
    )  # fmt: skip
    found = {"state": z[:n], "delay": z[n, ...], "switched_off": off[0, ...]}
    estimates, copies = reported(found, (off,))
    arguments = (
        y, u, *memory.values(), now, weights, table, table[0, m + 2 :].copy(), path, off, run,
        copies,
    )  # fmt: skip
    return Program(
        "Extended high-gain observer", _step, arguments, y, u, memory, estimates,
        leaves(now=now, table=table, path=path, off=off), {"switched_off": 1.0},
    )  # fmt: skip


def _step(
    y: Array, u: Array, z: Array, y_before: Array, u_before: Array, recent: Array, known: Array,
    now: Array, weights: Array | None, table: Array, gains: Array, path: Array, off: Array,
    run: Any, copies: Any,
) -> int:  # fmt: skip
    m, good = len(u_before) - 1, True
    for i in range(len(u)):
        now[0, i] = u[i]
    if weights is not None:
        _derive(u[0], u_before, recent, known, now, weights)
    off[0] = 0.0
    if known[0] > 0:
        _fill(y_before[0], y[0], u_before, now, gains, table)
        for i in range(len(z)):
            path[0, i] = z[i]
        good = _run(*run) == 2
        if good:
            for i in range(len(z)):
                z[i] = path[1, i]
    y_before[0] = y[0]
    for i in range(m + 1):
        u_before[i] = now[0, i]
    known[0] = min(known[0] + 1, m + 1)
    report(copies)
    good = good and finite((z, y_before, u_before))
    return 0 if good else 1


def _derive(
    u: float, u_before: Array, recent: Array, known: Array, now: Array, weights: Array
) -> None:
    """Find the derivatives of the input, for the first row those of the second."""
    m = len(u_before) - 1
    recent[m + 1] = u
    write_derivatives(recent, known[0], weights, now)
    if known[0] == 1:
        for i in range(1, m + 1):
            u_before[i] = now[0, i]
    for i in range(m + 1):
        recent[i] = recent[i + 1]


def _fill(
    y_before: float, y: float, u_before: Array, now: Array, gains: Array, table: Array
) -> None:
    """Write the rows of a step: measurements, inputs and their derivatives, and gains."""
    columns = 1 + len(u_before)
    for row in range(3):
        for i in range(len(gains)):
            table[row, columns + i] = gains[i]
    table[0, 0] = y_before
    table[1, 0] = 0.5 * y_before + 0.5 * y
    table[2, 0] = y
    for i in range(len(u_before)):
        table[0, 1 + i] = u_before[i]
        table[1, 1 + i] = 0.5 * u_before[i] + 0.5 * now[0, i]
        table[2, 1 + i] = now[0, i]
