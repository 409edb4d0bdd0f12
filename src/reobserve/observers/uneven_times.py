"""Times between the rows of a record that are not all the sampling period."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_floats, as_samples
from reobserve.observers.record import Record

Array = NDArray[np.float64]

EVEN = 1e-9  # of the sampling period: by how much even times may differ
DT_AND_TIME = 1e-6  # of the sampling period: how far times may be from those that dt led to


def uneven_times(
    model: Any, time: ArrayLike | None, state: Any, record: Record
) -> tuple[Array, Record] | None:
    """The times of the rows, and the record with what leads to each of them, or None if even.

    ``dt`` in the record leads from each row to the next one; ``time`` are those of the rows.

    Raises
    ------
    InputError
        If both are given, the times do not increase or dt is not positive; or if the time of the
        row before is not known.
    """
    rows, period, given = len(record.y), model.sampling_period, record.given.get("dt")
    held = state.held.get("dt") if isinstance(state.held, Mapping) else None
    if given is not None and time is not None:
        raise InputError("dt", "is given beside time, must be the only one of them")
    reached = state.sample is not None and (state.count or not np.isnan(state.sample).any())
    if time is not None or (given is None and held is None):
        able = getattr(model, "density", None) is not None or "Q" in record.given
        if time is None or not able or not model.continuous:
            return None
        times = as_samples("time", time, None, rows=rows, like="y").copy()
        last = state.count * period if state.time is None and reached else state.time
        first = period if last is None else times[0] - last
        if held is not None and abs(first - held[0]) > DT_AND_TIME * period:
            problem = (
                f"begins {first:.9g} s after the row before, from where dt was {held[0]:.9g} s"
            )
            raise InputError("time", problem)
        if state.time is None and reached and abs(first - period) > EVEN * period:
            raise InputError(
                "time", f"begins at {times[0]:.9g} s, but the state was reached without times, "
                f"which counts as {last:.9g} s; give time to the run before, too",
            )  # fmt: skip
        periods = np.concatenate([[first], np.diff(times)])
        if periods.min() <= 0:
            row = int(np.argmax(periods <= 0))
            problem = f"must increase, does not at row {row}, of {times[row]:.9g} s"
            raise InputError("time", problem)
        periods[np.abs(periods - period) <= EVEN * period] = period
        if (periods == period).all():
            return times, record._replace(time=times)
        return times, record._replace(time=times, periods=periods)
    lengths = np.full(rows, period) if given is None else as_floats("dt", given)
    if lengths.shape not in ((), (rows,)) or lengths.min() <= 0:
        raise InputError("dt", f"{shown(given)} must be a positive time, or {rows} of them")
    first = np.atleast_1d(period if held is None else held)
    periods = np.concatenate([first, np.broadcast_to(lengths, rows)])
    after = np.cumsum(periods[:-1])
    last = state.count * period if state.time is None else state.time
    times = after - after[0] if state.sample is None else last + after
    return times, record._replace(time=times, periods=periods)


def uneven_hint(model: Any) -> str:
    """The way in which a filter on this model takes other times, as the end of a sentence."""
    if getattr(model, "density", None) is not None:
        return ""
    if model.continuous:
        return "; for other times give from_ode the density of the noise, or Q by row"
    return "; for other times make the model by from_ode, with the density of the noise"
