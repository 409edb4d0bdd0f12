"""Filters of one mean and covariance, whose row is that of their loops."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.codegen.program import Program, finite, leaves, report, reported
from reobserve.core.errors import InputError
from reobserve.observers import kalman, nonlinear_filter
from reobserve.observers.fixed_gain import FixedGainObserver
from reobserve.observers.gaussian_filter import GaussianFilter, posteriors_of
from reobserve.observers.gaussian_state import KalmanState

Array = NDArray[Any]

TITLES = {
    "FixedGainObserver": "Linear observer of constant gain",
    "KalmanFilter": "Kalman filter",
    "AugmentedKalmanFilter": "Kalman filter with unknown inputs",
    "SmoothVariableStructureFilter": "Smooth variable structure filter",
    "ExtendedKalmanFilter": "Extended Kalman filter",
    "UnscentedKalmanFilter": "Unscented Kalman filter",
}


def filter_program(observer: GaussianFilter, state: KalmanState) -> Program:
    """A filter from a state on."""
    for name in ("f", "h"):
        if hasattr(observer.whole, name) and observer.whole.code(name) is None:
            problem = f"of a model with {name} as a function cannot be exported; give it as text"
            raise InputError("observer", problem)
    row, (n, p, m), sample = observer._new_row(), observer._sizes, state.sample
    model, method, y, inputs, _, after, rows, _, work, ends = row.arguments
    for part, values in zip(after, posteriors_of([state], n, m), strict=True):
        part[...] = values
    if sample is not None:
        row.inputs[0, :p] = sample[m:]
    linear = observer.steps is kalman.LINEAR
    # Loops of small models, which give the same numbers.
    if linear:
        work = work._replace(panel=None)
    else:
        work = work._replace(linear=work.linear._replace(panel=None))
    before = (method,) if linear else (method.weights, method.extended)
    run = (kalman if linear else nonlinear_filter)._run_rows
    u, started = np.empty(p), np.array(int(sample is not None))
    held = rows._replace(state=after.means[None], covariance=after.covariances[None])
    found = observer._by_name(held, None, ())
    alone = None
    if type(observer) is FixedGainObserver and observer.gate is None:  # without a covariance
        found, alone = {name: found[name] for name in ("innovation", "state")}, (after.means[0],)
    estimates, copies = reported({
        name: values[0, 0] if values.ndim > 2 else values.reshape(())
        for name, values in found.items() if not name.endswith("covariance")
    }, rows)  # fmt: skip
    return Program(
        TITLES.get(type(observer).__name__, type(observer).__name__), _step,
        (y, u, inputs, started.reshape(1), run, (model, None, *before), after, rows, work, ends,
         alone, copies),
        y, u, {**after._asdict(), "inputs": inputs, "started": started}, estimates,
        leaves(rows=rows, work=work, ends=ends),
    )  # fmt: skip


def _step(
    y: Array, u: Array, inputs: Array, started: Array, run: Any, model: Any, posteriors: Any,
    rows: Any, work: Any, ends: Array, alone: Any, copies: Any,
) -> int:  # fmt: skip
    p = len(u)
    for i in range(p):
        inputs[0, 1, i] = u[i]
    ends[0, 0] = 0
    run(*model, y, inputs, started[0] == 0, posteriors, rows, None, work, ends, 0, 0, 1)
    for i in range(p):
        inputs[0, 0, i] = u[i]
    started[0] = 1
    posteriors.counts[0] += 1.0
    report(copies)
    good = ends[0, 0] == 1 if alone is None else finite(alone)
    return 0 if good else 1
