"""`Observer.step` for a loop that minds every microsecond."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from reobserve.observers.contract import Observer, StateKind
from reobserve.observers.record import Record

Array = NDArray[np.float64]


def unchecked_step(
    observer: Observer[StateKind], state: StateKind, y: Array, u: Array
) -> tuple[StateKind, Mapping[str, Array]]:
    """The next state and the estimates of one row, with no checks of what it is given.

    Parameters
    ----------
    state
        One that this observer made.
    y, u
        As `Observer.run` would take them, of shape (1, p) and (1, m). So are the estimates, which
        keep their axis of samples.
    """
    record = Record(y, u)
    rows = observer._fill(state, record)
    if not observer._good(rows):
        time = np.array([observer._next_row(state) * observer.sampling_period])
        raise observer._divergence(state, rows, time, 0)
    return rows.state, rows.estimates
