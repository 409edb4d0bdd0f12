"""Policies of sampling that accept the rows of a record, for a check."""

from __future__ import annotations

import copy
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import DivergenceError, InputError
from reobserve.core.validation import parse
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.estimate import Estimation
from reobserve.estimation.findings import Findings
from reobserve.estimation.report_table import as_table
from reobserve.estimation.specification import Specification
from reobserve.estimation.text_rows import RowError
from reobserve.estimation.timestamps import first_known, least_jitter

Array = NDArray[np.float64]

_MOST_TRIES = 20
_LATE = 0.25  # periods by which a sample that is taken on time may be stamped late


def sample(findings: Findings, made: Estimation, cells: list[Array], lines: list[int]) -> bool:
    """Find policies of sampling that accept the rows, and run the observer by them.

    Return whether the rows are to be read again, as their times mean something else.
    """
    read = copy.copy(made.report)
    for _ in range(_MOST_TRIES):
        made.specification = parse(Specification, findings.tree)
        _prepare(made, read)
        try:
            for block in cells:
                made.gaps.feed(made.slots(block.copy()), False)
            *waiting, last = made.last_slots()
            for rows in waiting:
                made.gaps.feed(rows, False)
            made.gaps.feed(last, True)
        except RowError as error:
            row = error.row
            back = "goes back" in str(error)
            error.at_line(lines[row - 1] if lines else None)
            if _accept_clock(findings, made, error):
                findings.refuse(error)
                return True
            if _accept(findings, made, error, cells):
                findings.refuse(error)
                continue
            if back and made.layout.clock is not None and made.layout.clock.dates is None:
                findings.asked = findings.asked or (
                    "columns.time.wrap, if this is a counter that begins again"
                )
            for left_out in _leave_out(findings, cells, lines, row, back):
                findings.refuse(error, str(error), left_out)
        except InputError as error:
            findings.refuse(error)
            if not _accept(findings, made, error, cells):
                break
        else:
            _run(findings, made, cells, read)
            return False
    findings.final = True
    return False


def _prepare(made: Estimation, read: Any) -> None:
    """Begin with a report that knows what reading the rows has found."""
    made.prepare()
    made.report.origin, made.report.zone = read.origin, read.zone
    made.report.shift, made.report.left_out = read.shift, read.left_out


def _leave_out(
    findings: Findings, cells: list[Array], lines: list[int], row: int, back: bool
) -> list[int]:
    """Leave out a row that no key accepts, or all that go back, and return which."""
    findings.final = True
    every = np.concatenate(cells)
    wrong = np.zeros(len(every), bool)
    wrong[row - 1] = True
    if back:
        times = np.nan_to_num(every[:, 0], nan=-np.inf)
        wrong = times < np.maximum.accumulate(times)
        wrong &= ~np.isnan(every[:, 0])
    where = np.flatnonzero(wrong).tolist()
    cells[:] = [every[~wrong]]
    numbers = [lines[k] for k in where] if lines else [k + 1 for k in where]
    lines[:] = [line for line, left_out in zip(lines, wrong, strict=False) if not left_out]
    return numbers


def _accept(findings: Findings, made: Estimation, error: InputError, cells: list[Array]) -> bool:
    """State the policy by which a refused row is accepted, and return whether there is one."""
    key = _key(error)
    sampling, keys = made.specification.sampling, dict[str, Any]()
    if key in ("sampling.jitter", "sampling.period"):
        keys = _period(made, cells, key == "sampling.jitter")
    elif key == "sampling.uneven":
        keys = {"uneven": "linear"}
    elif key == "sampling.repeated":
        keys = {"repeated": _choose(findings, np.concatenate(cells))}
    elif key == "sampling.at_gap":
        coast = made.can_skip and sampling.at_gap == "refuse"
        keys = {"at_gap": "coast" if coast else "restart"}
    elif key == "sampling.missing":
        keys = {"missing": "skip" if made.can_skip else "interpolate"}
    elif key == "sampling.gap":
        keys = {"gap": 10.0 * sampling.period if sampling.longest > 20.0 * sampling.period else (
            2.0 * sampling.period
        )}  # fmt: skip
    return bool(keys) and findings.state("sampling", **keys)


def _key(error: InputError) -> str:
    """The key that states the policy which refuses a row."""
    return getattr(error, "key", "") or error.parameter


def _choose(findings: Findings, cells: Array) -> str:
    """Leave what becomes of rows that share a timestamp to the user, and return an assumption."""
    cells = cells[np.isfinite(cells[:, 0])]
    begins = np.flatnonzero(np.diff(cells[:, 0], prepend=-np.inf))
    sizes, values = np.diff(begins, append=len(cells)), cells[:, 1:]
    first, last, other = (
        int((np.isfinite(values) & (values != np.repeat(chosen, sizes, axis=0))).sum())
        for chosen in (values[begins], values[begins + sizes - 1], first_known(values, begins))
    )
    count = len(cells) - len(begins)
    refused = f"is refused, as {other} numbers differ from another of their column and timestamp"
    merge = refused if other else f"puts {count} rows into others, and loses no number"
    findings.choices = [
        f"  first: leaves out {count} rows, and {first} numbers that the first rows do not have",
        f"  last: leaves out {count} rows, and {last} numbers that the last rows do not have",
        f"  merge: {merge}",
        f"  spread: keeps {count} rows, but moves them evenly up to the next timestamp",
    ]
    return "first" if other else "merge"


def _accept_clock(findings: Findings, made: Estimation, error: InputError) -> bool:
    """State what the time of a refused row means, and return whether that may mend it."""
    time, clock = findings.tree["columns"].get("time", {}), made.layout.clock
    if error.parameter == "columns.time.zone":
        zone = re.search(r"put forward in (\S+);", str(error))
        return zone is not None and findings.state("columns", time={**time, "zone": zone[1]})
    if clock is None or clock.dates is None or _key(error) != "sampling.repeated":
        return False
    if "%H" in clock.dates.format or "%I" in clock.dates.format or len(clock.titles) > 1:
        return False
    guess = findings.suggestion.columns.get("time", {})
    both = isinstance(guess.get("column"), list) and time.get("column") in guess["column"]
    return both and findings.state("columns", time=guess)


def _period(made: Estimation, cells: list[Array], uneven: bool) -> dict[str, Any]:
    """The jitter, the period or the resampling that accepts the timestamps."""
    sampling, report = made.specification.sampling, DataReport()
    time = np.concatenate([made.layout.times(block, report) for block in cells])
    times = [time[np.isfinite(time)]]
    steps = np.diff(times[0])
    median = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    begun = made.timestamps.begun
    early = float(np.median(begun)) if begun else median
    if sampling.uneven == "refuse":
        first, mean = least_jitter(iter(times), sampling.period)
        periods = {sampling.period: first} if uneven else {}
        for value in (mean, median, early):
            if value:
                period = float(f"{value:.6g}")
                periods[period] = least_jitter(iter(times), period)[0]
        for period, least in periods.items():
            if least is not None and least <= _LATE:
                keys: dict[str, Any] = {} if period == sampling.period else {"period": period}
                return {**keys, **({"jitter": least} if least > sampling.jitter else {})}
    fits = [fit for fit in (sampling.period, median) if 0.2 * early <= fit <= 5.0 * early]
    fits = [fit for fit in fits if 0.2 * median <= fit <= 5.0 * median] or [early]
    keys = {} if fits[0] == sampling.period else {"period": float(f"{fits[0]:.6g}")}
    return {**keys, "uneven": "linear" if sampling.uneven == "refuse" else sampling.uneven}


def _run(findings: Findings, made: Estimation, cells: list[Array], read: Any) -> None:
    """Run the observer over the rows, for the summary of what `estimate` would do."""
    _prepare(made, read)
    made.alarms.clear()
    try:
        for block in cells:
            made.feed(block)
        made.finish()
        if not made.report.estimates:
            raise InputError(made.place, "has no row from which the observer could start")
    except (DivergenceError, InputError) as error:
        findings.refuse(InputError(made.place, str(error).removeprefix(f"{made.place}: ")))
        findings.final = True
    findings.summary = as_table(made.report, made.specification.sampling.period)
