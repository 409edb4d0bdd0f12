"""A record for exported code to be tested on: waves of the size of a tenth, and lost samples."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.observers.contract import Observer
from reobserve.observers.run import Run

Array = NDArray[np.float64]

ROWS = 60
_LOST = slice(20, 23)


def test_run(observer: Observer[Any], state: Any) -> tuple[Array, Array, Run[Any]]:
    """Measurements, inputs and the estimates of the library, one row a sample.

    Raises
    ------
    DivergenceError
        If the observer diverges on this record.
    """
    y, u = _waves(observer.measurements, 0.21), _waves(observer.inputs, 0.13)
    if observer.reads_missing:
        y[_LOST] = np.nan
    return y, u, observer.run(y, u if observer.inputs else None, state=state)


def _waves(columns: int, rate: float) -> Array:
    phase = rate * np.arange(ROWS)[:, None] * (1.0 + 0.3 * np.arange(columns)) + np.arange(columns)
    return np.round(0.1 * np.sin(phase), 6)
