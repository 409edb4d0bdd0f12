"""Distinguish an observer that diverges from a step that is too long for it.

A method of fixed step may leave the range of numbers where the observer itself does not: a gain
that passes -3e5 on the way to the origin asks for steps of microseconds there. So the piece of the
record around the divergence is integrated again, with half the step, a quarter and so on, the
samples in between taken from the same parabolas that the method reads. An observer whose estimates
stay finite with two steps, and agree, has only been given too long a step.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.observers.contract import Observer
from reobserve.observers.fixed_step import Steps

Array = NDArray[np.float64]

_HALVINGS = 10
_BACK = 128  # steps before the last finite row from which it starts again
_MORE = (
    16  # steps after it, beside as many as before: so that a slower escape is not taken for none
)
_AT_ONCE = 32  # steps that are refined together, so that memory stays small
_AGREE = 0.01


def finding(observer: Observer[Any], state: Any, steps: Steps, finite: int, begun: float) -> str:
    """The reason why a run diverged, as the rest of a sentence, empty if there is no shorter step.

    Parameters
    ----------
    observer, state, steps
        Those of the run.
    finite
        How many rows are finite, that at the start of the first step among them.
    begun
        The time [s] of that row.
    """
    last = max(finite - 1, 0)
    first = max(last - _BACK, 0)
    if first:
        state = observer._integrate(state, steps.part(0, first)).state
    piece = steps.part(first, min(steps.y.steps, first + 2 * (last - first) + _MORE))
    step = observer.sampling_period
    start = begun + first * step
    size = float(np.max(np.abs(_first_row(observer, state, piece)), initial=0.0))
    since = f"from t = {start:g} s on " if start else ""
    before: Array | None = None
    for halvings in range(1, _HALVINGS + 1):
        finer = observer._halved(state)
        if finer is None:
            return ""
        observer, state = finer
        end = _end(observer, state, piece, halvings)
        if end is not None and before is not None:
            scale = max(size, float(np.max(np.abs(end))))
            if float(np.max(np.abs(end - before))) <= _AGREE * scale:
                return (
                    f"{since}its step of {step:g} s is too long: "
                    f"with 1/{2 ** (halvings - 1)} of it the estimates stay finite"
                )
        before = end
    finest = f"with 1/{2**_HALVINGS} of its step of {step:g} s"
    if before is not None:
        return f"{since}{finest} the estimates stay finite, but still depend on the step"
    return f"{since}the observer itself diverges: {finest} it does so, too"


def _first_row(observer: Observer[Any], state: Any, piece: Steps) -> Array:
    rows = observer._integrate(state, piece.part(0, 1)).estimates
    return np.concatenate([np.ravel(array[0]) for array in rows.values()])


def _end(observer: Observer[Any], state: Any, piece: Steps, halvings: int) -> Array | None:
    """The last row that an observer writes with a finer record, or None if it diverges."""
    row = np.empty(0)
    for first in range(0, piece.y.steps, _AT_ONCE):
        part = piece.part(first, first + _AT_ONCE)
        for _ in range(halvings):
            part = part.halved()
        rows = observer._integrate(state, part)
        row = np.concatenate([np.ravel(array[-1]) for array in rows.estimates.values()])
        if rows.finite <= part.y.steps or not np.isfinite(row).all():
            return None
        state = rows.state
    return row
