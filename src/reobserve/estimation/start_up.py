"""The start-up of an observer: the rows in which it forgets how it started.

It is the time in which the response to a unit impulse in the first row of a measurement, the
largest over all of them, falls below a hundredth of its peak in the rows after that; or in which
the standard deviation of the estimate falls to within a fourth of its final value, if it does so
sooner.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import ReobserveError

Array = NDArray[np.float64]

NEAR = 1.25  # of a standard deviation that is no longer that of a start, or of a gap
_DECAYED = 0.01
_SHORTEST, _LONGEST = 64, 4096  # rows over which an impulse response is followed
_SAMPLES = 100  # of start-up where the response does not decay, or there is none


def start_up(
    run: Callable[[Array], Array], measurements: int, deviations: Sequence[int | None]
) -> NDArray[np.int_]:
    """The number of rows that each column needs to forget an impulse in the first measurements.

    ``run`` gives the columns for measurements, shape (k, ``measurements``); ``deviations`` are the
    places of their standard deviations, which may be near their final value sooner.
    """
    rows, columns = _SHORTEST, len(deviations)
    while True:
        silence = np.zeros((rows, measurements))
        try:
            base = run(silence)
            response = np.zeros(base.shape)
            for sensor in range(measurements):
                silence[0, sensor] = 1.0
                response = np.fmax(response, np.abs(run(silence) - base))
                silence[0, sensor] = 0.0
        except ReobserveError:  # where nothing moves, not every observer can run
            return np.full(columns, _SAMPLES)
        moved = response.any(axis=0)
        response[0] = 0.0  # where a residual is the impulse itself
        last = _last(response > _DECAYED * response.max(axis=0))
        last[~moved] = _SAMPLES
        if (last <= rows // 2).all() or rows == _LONGEST:
            last[last > _LONGEST // 2] = _SAMPLES
            break
        rows *= 2
    for column, place in enumerate(deviations):
        if place is not None:
            sigma, final = base[:, place], base[-1, place]
            far = sigma > NEAR * final
            if far[0]:  # of a start without a doubt, the deviation says nothing
                last[column] = min(last[column], _last(far[:, None])[0])
    return last


def _last(over: NDArray[np.bool_]) -> NDArray[np.int_]:
    """The number of rows, one or more, up to the last that is True in each column."""
    rows = len(over)
    return np.where(over.any(axis=0), rows - np.argmax(over[::-1], axis=0), 1)
