"""The sampling period of a record, and the policies that its timestamps ask for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.validation import parse
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dialect import Dialect
from reobserve.estimation.layout import lay_out
from reobserve.estimation.record_file import File
from reobserve.estimation.sampling_grid import least_jitter
from reobserve.estimation.specification import Specification
from reobserve.estimation.suggested_time import Unsure

Array = NDArray[np.float64]

_LATE = 0.25  # periods by which a sample that is taken on time may be stamped late
_MOST = 0.95  # of the intervals, by which the others are gaps, or late
_LONG = 10.0  # periods of a gap that is bridged
# Numbers at which counters begin again: of so many bits, digits, or seconds.
_WRAPS = sorted([
    *(2.0**bits for bits in (8, 16, 24, 31, 32)), *(10.0**digits for digits in range(2, 10)),
    *(scale * each for scale in (1, 1e3, 1e6) for each in (60.0, 3600.0, 86400.0, 604800.0)),
])  # fmt: skip


def sampling(path: Path, tree: dict[str, Any], unsure: Unsure) -> dict[str, Any]:
    """The section `sampling` that a record needs, with the number at which its counter wraps.

    It is read by the keys of ``tree``, as far as these read it.
    """
    times, empty, report, clock = list[Array](), 0, DataReport(), None
    try:
        specification = parse(Specification, {**tree, "sampling": {"period": 1.0}})
        file = File(path, Dialect.of(specification))
        design = specification.observer.design(1.0)
        layout = lay_out(specification.columns, design, file.header(), str(path))
        clock = layout.clock
        for block in file.blocks(layout.titles, layout.clock, report):
            times += [layout.times(block, report)] if clock is not None else []
            empty += int(np.isnan(block[:, -1]).sum())
    except InputError as error:
        unsure.of("file" if error.parameter == str(path) else error.parameter, error.problem)
    known = np.concatenate([*times, np.empty(0)])
    known = known[np.isfinite(known)]
    keys = dict[str, Any]()
    if clock is not None and (np.diff(known) < 0).any():
        if clock.dates is None:
            keys, known = _wrapped(known, clock.way.factor, clock.epoch(report))
        problem = "timestamps go back" + ", as those of a counter do" * bool(keys)
        unsure.of("columns.time.wrap" if keys else "columns.time", problem)
    keys |= _policies(known, unsure)
    if empty:
        unsure.of("sampling.missing", f"{empty} cells are empty; interpolate is for all observers")
        keys["missing"] = "skip"
    for key in {"columns.time.unit", "columns.time.column"} & unsure.sentences.keys():
        unsure.of("sampling.period", f"it depends on {key}", ask=key in unsure.asked)
    return keys


def _policies(times: Array, unsure: Unsure) -> dict[str, Any]:
    """The period, and policies by which the timestamps are accepted."""
    steps, keys = np.diff(times), dict[str, Any]()
    if not (steps > 0).any():
        unsure.of("sampling.period", "no timestamps state it", ask=True)
        return keys
    rising = steps[steps > 0]
    off = np.abs(rising / np.median(rising) - 1.0)
    mean = float(rising[off < (1e-3 if (off < 1e-3).mean() > _MOST else 0.5)].mean())
    period = next(
        short for short in (float(f"{mean:.{digits}g}") for digits in range(1, 8))
        if abs(short - mean) <= 5e-4 * mean
    )  # fmt: skip
    keys["period"] = period
    if same := len(steps) - len(rising):
        problem = f"{same} rows have the timestamp of the row before: first, last, merge or spread"
        unsure.of("sampling.repeated", problem)
    if same > 0.1 * len(steps):
        spread = (times[-1] - times[0]) / len(steps)
        unsure.of("sampling.period", f"rows that are spread are {spread:.3g} s apart")
    jitter = least_jitter([times], period)[0]
    if jitter is None or jitter > _LATE:
        keys["uneven"] = "linear"
        unsure.of("sampling.uneven", f"timestamps are far from a grid of {period:g} s")
    elif jitter > 0.01:
        keys["jitter"] = jitter
        unsure.of("sampling.jitter", "samples may be taken on time, or else uneven resamples them")
    longest = float(steps.max()) / period
    if longest > 1.5:
        keys["missing"] = "skip"
        problem = f"of {period:g} s, {longest:.4g} periods are between two rows"
        unsure.of("sampling.missing", f"{problem}; interpolate is for all observers")
    if longest > _LONG:
        keys["at_gap"] = "restart"
        unsure.of("sampling.at_gap", "refuse, or coast of Kalman filters, may be meant")
    return keys


def _wrapped(times: Array, scale: float, epoch: int) -> tuple[dict[str, Any], Array]:
    """The number at which a counter begins again, in units of a ``scale`` [s], and the times."""
    steps = np.diff(times) / scale
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    highest, sizes = times.max() / scale + epoch, step - steps[steps < 0]
    near = [wrap for wrap in _WRAPS if wrap > highest and (abs(sizes - wrap) < 20 * step).all()]
    if len(sizes) > 1 and np.ptp(sizes) <= 1e-6 * sizes[0] and sizes[0] > highest:
        near.append(float(sizes[0]))
    if not near:
        return {}, times
    # t_k = x_k + W (number of falls before k)
    return {"wrap": near[0]}, times + near[0] * scale * np.cumsum(np.append(0.0, steps < 0))
