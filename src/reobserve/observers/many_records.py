"""Runs of many records at once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from reobserve.core.code_paths import cores
from reobserve.core.errors import InputError, located
from reobserve.core.interrupts import stopped_by
from reobserve.core.matrices import all_finite
from reobserve.observers.contract import Observer
from reobserve.observers.record import Record, Rows, depth_of
from reobserve.observers.run import Run


def in_threads(block: Callable[[slice], None], records: int) -> None:
    """Call a function for parts of many records, on all cores."""
    threads, stop = min(records, cores()), Event()
    cuts = np.linspace(0, records, threads + 1).astype(int).tolist()

    def stoppable(cut: slice) -> None:
        with stopped_by(stop):
            block(cut)

    with ThreadPoolExecutor(threads) as pool:
        try:
            list(pool.map(stoppable, map(slice, cuts[:-1], cuts[1:])))
        except BaseException:  # what one part raises, or the handler of a signal
            stop.set()
            raise


def part(arrays: Any, cut: slice) -> Any:
    """A named tuple of arrays for a part of the records."""
    return type(arrays)(*[array[cut] for array in arrays])


def run_many(
    observer: Observer[Any], y: Any, u: Any, state: Any, time: ArrayLike | None, loud: bool,
    given: Mapping[str, Any],
) -> Run[Any]:  # fmt: skip
    """Run many records: a run with that axis, of which the state is a tuple of states."""
    count, alone = len(y), u is None or depth_of(u) < 3
    if not count:
        raise InputError("y", "has no record, must have one or more")
    for name, each in (("u", u if not alone else y), ("start", state)):
        if isinstance(each, list | tuple | np.ndarray) and len(each) != count:
            raise InputError(name, f"is of {len(each)} records, must be of {count} like y")
    records: list[Record] = []
    states: list[Any] = []
    times = np.empty(0)
    for r in range(count):
        with located(f"record {r}"):
            record = observer._read(y[r], u if alone else u[r], None, None, given)
            start = state[r] if isinstance(state, list | tuple) else state
            start = observer._start(record.y[0]) if start is None else observer._checked(start)
            own, record = observer._timed(time, start, record)
            if records and not np.array_equal(own[0], times[0]):
                raise InputError("start", "is at another time than that of record 0")
            times = own
            if records and len(record.y) != len(records[0].y):
                problem = f"has {len(record.y)} rows, must have {len(records[0].y)} like record 0"
                raise InputError("y", problem)
        records.append(record)
        states.append(start)
    result, diverged_at = observer._run_records(records, states), np.full(count, np.nan)
    for r, good in enumerate(result.goods):
        if good < len(times):
            if loud:
                with located(f"record {r}"):
                    rows = Rows({}, good, None, finding=result.findings[r])
                    raise observer._divergence(states[r], rows, times, good)
            diverged_at[r] = observer._last_finite(states[r], times, good)
            result.states[r] = states[r]
            for values in (*result.estimates.values(), *result.before.values()):
                if values.flags.writeable:  # else a view of another one
                    values[r, good:] = np.nan
    units = {name: observer.units.get(name, "") for name in result.estimates}
    missing = [
        0 if all_finite(entry.y) else int(np.isnan(entry.y).any(axis=1).sum()) for entry in records
    ]
    return Run(
        times, result.estimates, units, tuple(result.states),
        diverged_at if np.isfinite(diverged_at).any() else None, result.before,
        np.array(missing), observer.component_names, None, observer._periods,
        None if None in result.sources else tuple(result.sources),
    )  # fmt: skip
