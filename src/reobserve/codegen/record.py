"""A record for exported code to be tested on, with lost samples where the observer takes them.

Filters get one of their own model, with noise as they expect it: far from that, rounding grows to
any size in a likelihood. Others get waves of the size of a tenth, and their derivatives in columns
of their own where these are read. No signal starts at zero, where some observers do.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.observers.contract import Observer
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.imm import IMM
from reobserve.observers.run import Run

Array = NDArray[np.float64]

ROWS = 60
_LOST, _PARTLY = slice(20, 23), slice(30, 33)
_PHASE = 0.6


def test_run(
    observer: Observer[Any], state: Any, columns: tuple[int, int]
) -> tuple[Array, Array, Run[Any]]:
    """Measurements, inputs and the estimates of the library, one row a sample.

    ``columns`` are as `reobserve.estimation.families.program.program_of` has them.
    """
    p, m = columns
    make = _waves
    if isinstance(observer, ExtendedHighGainObserver):
        make = partial(_derivatives, period=observer.sampling_period)
    y, u = make(p, 0.21), make(m, 0.13)
    if isinstance(observer, GaussianFilter | IMM):
        y = _simulated(observer, state, u)
        y[_LOST] = np.nan
        if observer.measurements > 1:
            y[_PARTLY, 0] = np.nan
    return y, u, observer.run(y, u if observer.inputs else None, start=state)


def _waves(columns: int, rate: float) -> Array:
    phase = rate * np.arange(ROWS)[:, None] * (1.0 + 0.3 * np.arange(columns)) + np.arange(columns)
    wave: Array = np.round(0.1 * np.sin(phase + _PHASE), 6)
    return wave


def _derivatives(columns: int, rate: float, period: float) -> Array:
    """A wave and its derivatives."""
    phase = _PHASE + rate * np.arange(ROWS)[:, None] + 0.5 * np.pi * np.arange(columns)
    return np.round(0.1 * (rate / period) ** np.arange(columns) * np.sin(phase), 6)


def _simulated(observer: GaussianFilter | IMM, state: Any, u: Array) -> Array:
    """Measurements as the filter, or the first one of a bank, predicts them, with noise."""
    first: Any = observer
    if isinstance(observer, IMM):
        first = observer.filters[0]
        state = first.init(state.means[0], state.covariances[0])
        if observer.inputs:  # which a filter of a delay reads twice
            u = np.tile(u, first.inputs // observer.inputs)
    p = observer.measurements
    noise = np.random.default_rng(ROWS).standard_normal((ROWS, p)) * np.sqrt(np.diag(first.model.R))
    y = np.empty((ROWS, p))
    for k in range(ROWS):
        y[k] = noise[k] - first.step(state, np.zeros(p), u[k])[1]["innovation"]
        state, _ = first.step(state, y[k], u[k])
    return y
