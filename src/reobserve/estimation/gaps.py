"""Policies for missing rows: stretches without a gap for the observer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.interpolation import Settled
from reobserve.estimation.specification import Sampling

Array = NDArray[np.float64]

# What became of a row: of samples alone; some of its values between samples; some of its sensors
# missing; none of them there; the first one after a gap.
STATUSES = ("measured", "filled", "partial", "predicted", "restarted")
MEASURED, FILLED, PARTIAL, PREDICTED, RESTARTED = range(5)


class Stretch(NamedTuple):
    """Rows that follow one another, with ``fresh`` ones where the observer starts."""

    time: Array
    y: Array
    u: Array
    status: NDArray[np.int8]
    fresh: bool


def joined(stretches: Sequence[Stretch]) -> Stretch:
    """One stretch of several, from a start of the observer on."""
    time, y, u, status = (np.concatenate(part) for part in list(zip(*stretches, strict=True))[:4])
    return Stretch(time, y, u, status, True)


@dataclass
class Gaps:
    """Takes rows at the sampling period, with nan for what is missing.

    ``reads_missing`` says that the observer can do without measurements: it is then corrected by
    those sensors that there are, and by none where rows are skipped or coasted over. Columns that
    it ``holds`` lack a value before their first one only, where the observer does not start.
    """

    sampling: Sampling
    report: DataReport
    place: str
    columns: tuple[str, ...]
    measurements: int
    reads_missing: bool
    holds: tuple[bool, ...] = ()
    last: float | None = None  # the time of the last row that was measured
    started: bool = False
    in_gap: bool = False

    def feed(self, rows: Settled, final: bool = False) -> list[Stretch]:
        """The stretches that rows make. After the ``final`` ones nothing is measured any more."""
        if not len(rows.time):
            return []
        p = self.measurements
        y, u = rows.values[:, :p], rows.values[:, p:]
        there: NDArray[np.bool_] = np.isfinite(rows.values)
        self.report.refusals.forget(float(rows.time[0]))
        self._count(rows, there)
        if there.all():
            begins = self._begins(float(rows.time[0]))
            self.last = float(rows.time[-1])
            status = np.where(rows.between.any(axis=1), FILLED, MEASURED).astype(np.int8)
            status[0] = RESTARTED if begins and self.report.restarts else status[0]
            self._tell(status)
            return [Stretch(rows.time, y, u, status, begins)]
        known: NDArray[np.bool_] = np.asarray(there[:, p:].all(axis=1))
        full: NDArray[np.bool_] = known & there[:, :p].all(axis=1)
        usable = full
        if self.reads_missing and self.sampling.missing != "refuse":
            usable = known & there[:, :p].any(axis=1)
        status = np.where(
            full, np.where(rows.between.any(axis=1), FILLED, MEASURED), PARTIAL
        ).astype(np.int8)
        runs: list[list[int]] = []
        fresh: list[bool] = []
        for k in range(len(rows.time)):
            begins = False
            if usable[k]:
                begins = self._begins(float(rows.time[k]))
                if begins and self.report.restarts:
                    status[k] = RESTARTED
            elif not self._is_refused(k, rows) and self._bridges(k, rows, bool(known[k]), final):
                status[k] = PREDICTED
            else:
                continue
            if begins or not runs:
                runs.append([])
                fresh.append(begins)
            runs[-1].append(k)
        stretches = [
            Stretch(rows.time[part], y[part], u[part], status[part], begins)
            for part, begins in zip(runs, fresh, strict=True)
        ]
        for stretch in stretches:
            self._tell(stretch.status)
        return stretches

    def _begins(self, now: float) -> bool:
        """True if the observer starts with a usable row, which closes a gap."""
        if self.in_gap:
            self.report.close_gap(now)
            self.in_gap = False
        begins = not self.started
        if begins and self.last is not None:
            self.report.restarts += 1
        self.started, self.last = True, now
        return begins

    def _is_refused(self, k: int, rows: Settled) -> bool:
        """True if a row lacks what is refused, and reading goes on as if it were there.

        Of sensors some of which are missing, a policy reads the others.
        """
        now, even, p = float(rows.time[k]), self.sampling.uneven == "refuse", self.measurements
        refused = self.report.refusals.excuses(now, even)
        if not refused and self.sampling.missing == "refuse" and self.reads_missing:
            there = np.isfinite(rows.values[k])
            refused = bool(there[:p].any() and there[p:].all())
            if refused:
                self._refuse("missing", k, rows)
        if refused:
            self.started, self.last, self.in_gap = True, now, False
        return refused

    def _bridges(self, k: int, rows: Settled, known: bool, final: bool) -> bool:
        """True if the observer predicts over a row without measurements, which may open a gap."""
        sampling, now = self.sampling, float(rows.time[k])
        first = not self.started and not self.in_gap
        if first and any(self.holds) and np.isnan(rows.values[k, list(self.holds)]).any():
            self.report.before_start += 1
            return False
        refused = sampling.missing == "refuse"
        if refused:
            self._refuse("missing", k, rows)
        if not self.started or self.last is None:
            if self.in_gap:
                self.report.dropped += 1
            else:
                self.report.before_start += 1
            return False
        beyond = sampling.period if refused and not self.reads_missing else 0.0
        near = now - self.last + beyond <= sampling.longest * (1.0 + 1e-9)
        if near and (refused or (sampling.missing == "skip" and known)):
            return True
        if final and not self.in_gap and sampling.missing == "interpolate":
            self.report.after_end += 1
            return False
        if not self.in_gap:
            if sampling.at_gap == "refuse":
                self._refuse("at_gap", k, rows)
            self.in_gap = True
            self.report.open_gap(self.last)
        if sampling.at_gap == "coast" and known:
            return True
        self.report.dropped += 1
        self.started = False
        return False

    def _refuse(self, key: str, k: int, rows: Settled) -> None:
        now, refusals = float(rows.time[k]), self.report.refusals
        lost = np.flatnonzero(np.isnan(rows.values[k]))
        listed = ", ".join(self.columns[c] for c in lost[:4])
        at, where = refusals.at(now)
        kind = (f"sampling.{key}", listed, where)
        refusals.refuse(kind, lambda: self._refusal(key, now, listed), at)

    def _refusal(self, key: str, now: float, listed: str) -> InputError:
        said = self.report.said
        if key == "missing":
            others = "interpolate or skip" if self.reads_missing else "interpolate"
            when = f"at {said(now)}"
        else:
            others = "restart or coast" if self.reads_missing else "restart"
            since = "the start" if self.last is None else said(self.last, 14)
            when = f"from {since} on for longer than sampling.gap, {self.sampling.longest:g} s"
        problem = f"{listed} missing {when}; sampling.{key} is refuse, set it to {others}"
        return InputError(self.place, problem)

    def _count(self, rows: Settled, there: NDArray[np.bool_]) -> None:
        for c, name in enumerate(self.columns):
            self.report.count(self.report.filled, name, (rows.between[:, c] & there[:, c]).sum())

    def _tell(self, status: NDArray[np.int8]) -> None:
        for code, count in zip(*np.unique(status, return_counts=True), strict=True):
            self.report.count(self.report.statuses, STATUSES[code], count)
