"""Times at which there is to be a sample, and rows that are lost or repeated, by timestamps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.estimation.clock import Dates
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.dates import SECOND, of_nanoseconds, skipping_zone
from reobserve.estimation.refusals import RowError
from reobserve.estimation.sampling_grid import RESAMPLING, UnevenError, placed
from reobserve.estimation.specification import Sampling

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MOST_SLOTS = 1_000_000  # in one gap, and beyond one a row in all
_LOOKED_AT = 20  # intervals, before the period is checked
_FINER = 10  # slots a row, if rows are resampled
_LONG = 100  # slots in a gap that are not filled before
_WRONG = 0.25  # how far their median may be off, which jitter moves by less
_HOUR = 3600.0  # [s]
_ROUNDING = 1e-6  # in periods
# Policies that wait for the next timestamp, and the end of a warning.
_GROUPS = {
    "spread": "before, and were spread evenly", "last": "after, and were left out",
    "merge": "before, and were merged with it",
}  # fmt: skip


@dataclass
class Timestamps:
    """Reads the timestamps of rows, in order, and says at which times there is to be a sample.

    With ``uneven: refuse`` those are the timestamps, and times evenly between two of them where
    rows were lost; else times a sampling period apart from the first timestamp on. Of a gap that no
    policy bridges only the first slots are given.
    """

    sampling: Sampling
    report: DataReport
    place: str
    dates: Dates | None = None
    counts: bool = False  # by a counter whose period is stated
    columns: tuple[tuple[str, str], ...] = ()  # names and units of the values
    begun: list[float] = field(default_factory=list)  # the first intervals
    grid: Array = field(default_factory=lambda: np.full(2, np.nan))
    on_grid: bool = True  # by the period, until that is refused
    jitter: float | None = None  # by which rows are placed once it is refused
    # Rows with the last timestamp: all that wait for the next one where they are spread, or one.
    # Their numbers are the last column.
    held_time: Array = field(default_factory=lambda: np.empty(0))
    held_values: Array = field(default_factory=lambda: np.empty((0, 0)))
    # The first rows, if a long gap is among them, until the period is checked.
    early_time: Array = field(default_factory=lambda: np.empty(0))
    early_values: Array = field(default_factory=lambda: np.empty((0, 0)))

    @property
    def _bridged(self) -> int:
        """The number of slots of a gap that are worth having."""
        return int(min(self.sampling.longest / self.sampling.period, MOST_SLOTS)) + 2

    @property
    def _most(self) -> float:
        """The number of slots of a gap that are given."""
        return np.inf if self.sampling.at_gap == "coast" else float(self._bridged)

    def read(self, time: Array, values: Array) -> tuple[Array, Array, Array]:
        """The rows to use, their timestamps first, and the times of the slots up to the last."""
        report, sampling = self.report, self.sampling
        rows, report.rows = report.rows, report.rows + len(time)
        # The last column is the number of the row, for messages.
        values = np.column_stack([values, np.arange(rows + 1.0, report.rows + 1.0)])
        if np.isnan(time).any():
            known = ~np.isnan(time)
            unstamped = np.setdiff1d(values[~known, -1], report.refusals.left_out)
            if sampling.uneven == "refuse" and len(unstamped):
                error = RowError(self.place, "{at} has no timestamp", int(unstamped[0]))
                report.refusals.refuse(("sampling.uneven",), error, unstamped)
                report.refusals.leave_out(unstamped)
            report.unstamped += int((~known).sum())
            time, values = time[known], values[known]
        time, values = self._forward(time, values)
        if sampling.repeated in _GROUPS:
            time, values = self._grouped(time, values)
        return self._checked(time, values)

    def finish(self) -> tuple[Array, Array, Array]:
        """The same of rows that wait for a timestamp which does not come."""
        report, repeated = self.report, self.sampling.repeated
        held = len(self.held_time) if repeated in _GROUPS else 0
        time = self.held_time[:held] + self.sampling.period * np.arange(held)
        report.repeated += max(held - 1, 0)
        checked = self._checked(time, self.held_values[:held], True)
        median = float(np.median(self.begun)) if self.begun else np.inf
        if self.sampling.uneven != "refuse" and median < self.sampling.period / 1.5:
            report.warn(
                f"time: rows every {median:.4g} s are resampled to one every "
                f"{self.sampling.period:g} s without a low-pass filter, so faster oscillations "
                "appear as slower ones"
            )
        if report.repeated:
            report.warn(
                f"time: {report.repeated} of {report.rows} rows have the timestamp of the row "
                f"{_GROUPS.get(repeated, 'before, and were left out')}"
            )
        self.held_time = time[:0]
        return checked

    def _forward(self, time: Array, values: Array) -> tuple[Array, Array]:
        """Rows that are not before another one that precedes them, as these are refused."""
        begun = [] if self.report.last is None else [self.report.last]
        begun = [-np.inf, *begun, *self.early_time[-1:].tolist(), *self.held_time[-1:].tolist()]
        back = time < np.maximum.accumulate(np.concatenate([[max(begun)], time]))[:-1]
        if not back.any():
            return time, values
        self._refuse(back, "goes back", time, values)
        return time[~back], values[~back]

    def _grouped(self, time: Array, values: Array) -> tuple[Array, Array]:
        """Rows up to the last timestamp, of which those that share one are one or are spread."""
        if len(self.held_time):
            time = np.concatenate([self.held_time, time])
            values = np.concatenate([self.held_values, values])
        if not len(time):
            return time, values
        begins = np.flatnonzero(np.diff(time, prepend=-np.inf))
        if self.sampling.repeated == "merge":
            self._merge(values, begins)
        if self.sampling.repeated != "spread":
            self.report.repeated += len(time) - len(begins)
            ends = np.append(begins[1:], len(time)) - 1
            time, values, begins = time[ends], values[ends], np.arange(len(ends))
        self.held_time, self.held_values = time[begins[-1] :].copy(), values[begins[-1] :].copy()
        if self.sampling.repeated == "spread":
            time = self._spread(time, begins)
        return time[: begins[-1]], values[: begins[-1]]

    def _merge(self, values: Array, begins: NDArray[np.int_]) -> None:
        """Give rows that share a timestamp the numbers of each other."""
        sizes = np.diff(begins, append=len(values))
        merged = np.repeat(first_known(values[:, :-1], begins), sizes, axis=0)
        other = np.isfinite(values[:, :-1]) & (values[:, :-1] != merged)
        if other.any():
            (row, column), key = np.argwhere(other)[0], "sampling.repeated"
            name, unit = self.columns[column]
            one, two = (f"{each[row, column]:.9g} {unit}".strip() for each in (merged, values))
            problem = f"{{at}} has {two} and a row before it, with the same timestamp, {one}"
            hint = "sampling.repeated may be first or last, which leave out rows, instead of merge"
            error = RowError(name, f"{problem}; {hint}", int(values[row, -1]))
            self.report.refusals.refuse((key, name), error, values[other.any(axis=1), -1])
        values[:, :-1] = merged

    def _spread(self, time: Array, begins: NDArray[np.int_]) -> Array:
        """Times of the rows before the last timestamp, evenly up to the next one.

        They are no farther than a period apart. The first ones end there, since a record may begin
        between two timestamps.
        """
        at, n = time[begins], np.diff(begins)
        step = np.minimum(np.diff(at) / n, self.sampling.period)
        start = at[:-1].copy()
        if len(start) and n[0] > 1 and self.report.first is None:
            start[0] = at[1] - n[0] * step[0]
        place = np.arange(int(begins[-1])) - np.repeat(begins[:-1], n)
        self.report.repeated += int((n - 1).sum())
        return np.repeat(start, n) + np.repeat(step, n) * place

    def _checked(
        self, time: Array, values: Array, final: bool = False
    ) -> tuple[Array, Array, Array]:
        """The rows to use, none as long as a gap is filled only if the period is right."""
        if len(self.early_time):
            time = np.concatenate([self.early_time, time])
            values = np.concatenate([self.early_values, values]) if len(values) else (
                self.early_values
            )  # fmt: skip
        known = [] if self.report.last is None else [self.report.last]
        steps = np.diff(np.concatenate([known, time]))
        early = len(self.begun) + np.count_nonzero(steps > 0) < _LOOKED_AT
        if early and not final and (self._filled(steps) > _LONG).any():
            self.early_time, self.early_values = time.copy(), values.copy()
            return time[:0], values[:0, :-1], time[:0]
        self.early_time, self.early_values = time[:0].copy(), values[:0].copy()
        return self._taken(time, values)

    def _filled(self, steps: Array) -> Array:
        """The slots between rows that policies may fill."""
        slots: Array = np.clip(np.floor(steps / self.sampling.period - 0.5), 0.0, self._most)
        return slots

    def _check_filled(self, steps: Array) -> None:
        """Refuse to fill more slots in all gaps together than rows are worth, and a million."""
        sampling, report = self.sampling, self.report
        filled = self._filled(steps)
        report.filling += int(min(filled.sum(), 1e15))
        share = 1 if sampling.uneven == "refuse" else _FINER
        if report.filling <= MOST_SLOTS + share * report.rows:
            return
        self.check_period()
        if not self.on_grid:
            return
        coast = sampling.at_gap == "coast"
        key, hint = "gap", "a shorter one fills fewer"
        if coast:
            key, hint = "at_gap", "restart fills none"
        error = InputError(
            f"sampling.{key}",
            f"{sampling.at_gap if coast else f'{sampling.longest:g} s'} would fill "
            f"{report.filling} sampling periods of {sampling.period:g} s in the gaps of "
            f"{self.place}; {MOST_SLOTS} and {share} for each row are the most; {hint}",
        )
        report.refusals.refuse(("sampling.gap",), error)
        self.on_grid = False

    def _taken(self, time: Array, values: Array) -> tuple[Array, Array, Array]:
        report, even = self.report, self.sampling.uneven == "refuse"
        begin = [] if report.last is None else [report.last]
        steps = np.diff(np.concatenate([begin, time]))
        if (steps == 0).any():
            self._check_repeated(steps, time, values)
            again = np.concatenate([[False] * (len(time) - len(steps)), steps == 0]).astype(bool)
            report.repeated += int(again.sum())
            time, values, steps = time[~again], values[~again], steps[steps > 0]
        if not len(time):
            return time, values[:, :-1], time
        self._check_hour(steps, time, values)
        self._check_early_period(report.refusals.between_rows(steps, values[:, -1]))
        if self.on_grid:
            self._check_filled(steps)
        report.refusals.take(time, values[:, -1])
        slots = time
        if self.on_grid:
            slots = self._even(steps, time, values) if even else self._regular(time, steps)
        if not self.on_grid:  # nothing but empty cells is missing
            slots = time if even and self.sampling.missing == "refuse" else time[:0]
        if report.first is None:
            report.first = float(time[0])
        report.last = float(time[-1])
        if self.sampling.repeated not in _GROUPS:
            self.held_time, self.held_values = time[-1:].copy(), values[-1:].copy()
        return time, values[:, :-1], slots

    def _check_repeated(self, steps: Array, time: Array, values: Array) -> None:
        """Refuse rows with the timestamp of the one before, and other values, by the policy."""
        if self.sampling.repeated == "first":
            return
        other = steps == 0
        if self.sampling.uneven != "refuse":
            known = values if len(time) > len(steps) else np.concatenate([self.held_values, values])
            same = (known[1:] == known[:-1]) | (np.isnan(known[1:]) & np.isnan(known[:-1]))
            other &= ~same[:, :-1].all(axis=1)
        if other.any():
            self._refuse(other, "stands still", time, values)

    def _refuse(self, wrong: Flags, said: str, time: Array, values: Array) -> None:
        at, dates = int(np.argmax(wrong)) + len(time) - len(wrong), self.dates
        key = "sampling.repeated" if said == "stands still" else ""
        hint = f"; {key} may be first, last, merge or spread" if key else ""
        if said == "goes back" and dates is None and not self.counts:
            hint = "; where a counter begins again, columns.time.wrap states its period"
        if said == "goes back" and dates is not None and dates.floating:
            hint = (
                "; a date without an offset is one of UTC unless columns.time.zone is stated, as "
                "Europe/Berlin"
            )
        now = self.report.said(float(time[at]))
        problem = f"{{at}}: the timestamp {said}, at {now}{hint}"
        rows = values[len(time) - len(wrong) :][wrong, -1]
        error = RowError(self.place, problem, int(rows[0]))
        self.report.refusals.refuse((key or "columns.time",), error, rows)
        self.report.refusals.leave_out(rows)

    def _check_hour(self, steps: Array, time: Array, values: Array) -> None:
        """Refuse an hour that is missing where clocks are put forward, if dates may be local."""
        period, report = self.sampling.period, self.report
        if self.dates is None or not self.dates.floating or period > _HOUR:
            return
        late = np.flatnonzero(np.abs(steps - _HOUR - period) <= max(0.5 * period, 1.0))
        for k in late.tolist():
            at = k + len(time) - len(steps)
            before, after = (
                of_nanoseconds((report.origin or 0) * SECOND + round(float(t) * SECOND))
                for t in (time[at] - steps[k], time[at])
            )
            if zone := skipping_zone(before, after):
                row, key = int(values[at, -1]), "columns.time.zone"
                error = RowError(
                    key,
                    f"is missing: {{at}} of {self.place}, {after:%Y-%m-%dT%H:%M:%S}, is an hour "
                    f"late, as if clocks had been put forward in {zone}; state the zone of these "
                    "times, or UTC",
                    row,
                )
                report.refusals.refuse((key,), error, [row])
                report.refusals.leave_out([row - 0.5])

    def _check_early_period(self, steps: Array) -> None:
        """Check the period once there are enough intervals."""
        missing = _LOOKED_AT - len(self.begun)
        if missing > 0 and len(steps):
            self.begun += steps[:missing].tolist()
            if len(self.begun) == _LOOKED_AT:
                self.check_period()

    def check_period(self) -> None:
        """Refuse a period that is not that of the timestamps."""
        if not (self.begun and self.on_grid):
            return
        median, period = float(np.median(self.begun)), self.sampling.period
        ratio = median / period
        even = self.sampling.uneven == "refuse"
        if abs(ratio - 1.0) > _WRONG if even else not 1 / _FINER <= ratio <= _FINER:
            hint = f" ({RESAMPLING})" if even else ""
            self._refuse_grid(InputError(
                "sampling.period",
                f"{period:g} s disagrees with the timestamps of {self.place}{hint}, which go on by "
                f"{median:.6g} s (the median of the first {len(self.begun)} intervals)",
            ))  # fmt: skip

    def _refuse_grid(self, error: InputError, rows: Sequence[int] = ()) -> None:
        """Refuse the period, or the jitter, by which rows have places."""
        refusals = self.report.refusals
        if error.parameter == "sampling.period":
            self.on_grid = False
            refusals.drop_lost()
            rows = ()
        refusals.refuse((error.parameter,), error, rows)

    def follows(self, time: float) -> bool:
        """Take a timestamp if it is in its place, a period after the one before."""
        grid, passed, sampling = self.grid.copy(), np.zeros(1), self.sampling
        accepted, used = placed(
            np.array([time]), grid, sampling.period, sampling.jitter, True, passed
        )
        if accepted == 0 or passed[0] != 1.0:
            return False
        self.grid[:], self.report.jitter = grid, max(self.report.jitter, used)
        return True

    def _even(self, steps: Array, time: Array, values: Array) -> Array:
        report, period, jitter = self.report, self.sampling.period, self.sampling.jitter
        passed, refuse = np.zeros(len(time)), self.jitter is None
        reach = jitter if self.jitter is None else self.jitter
        accepted, used = placed(time, self.grid, period, reach, refuse, passed)
        if accepted < len(time):
            if len(self.begun) == _LOOKED_AT:
                self.check_period()
            if not self.on_grid:
                return time
            off = (time[accepted] - 0.5 * float(self.grid.sum())) / period
            least = np.ceil(100.0 * used - 1e-6) / 100.0
            said = report.said(float(time[accepted]), 14)
            error, self.jitter = report.refusals.survey(UnevenError(
                f"{jitter:g} is exceeded in {{at}} of {self.place}: its timestamp, {said}, is "
                f"{off:.2g} sampling periods of {period:g} s off its place",
                int(values[accepted, -1]),
                float(least) if least < 0.5 else None, "the rows up to there",
            ))  # fmt: skip
            self._refuse_grid(error, [int(values[accepted, -1])])
            self.on_grid = self.jitter is not None
            if self.jitter is None:
                return time
            self.grid[:] = time[accepted] + self.jitter * period * np.array([-1.0, 1.0])
            rest = slice(accepted + 1, None)
            placed(time[rest], self.grid, period, self.jitter, False, passed[rest])
        report.jitter = max(report.jitter, used)
        passed = passed[len(time) - len(steps) :]
        report.intervals += len(passed)
        report.lost += int(passed.sum()) - len(passed)
        starts = time if report.last is None else np.concatenate([[report.last], time])
        first = len(time) - len(steps)  # the row that the first step leads to
        parts, done = [], 0
        for k in np.flatnonzero(passed > 1.0).tolist():
            inside = np.arange(1, min(passed[k], self._most))
            parts += [time[done : k + first], starts[k] + steps[k] * (inside / passed[k])]
            done = k + first
        return np.concatenate([*parts, time[done:]])

    def _regular(self, time: Array, steps: Array) -> Array:
        """The times t0 + k T up to the last timestamp."""
        report, period = self.report, self.sampling.period
        long = steps > self._bridged * period
        report.intervals += len(steps) - int(long.sum())
        for step in steps[long].tolist():  # in order, so that blocks have the same sum
            report.unbridged += step
        _, used = placed(time, self.grid, period, 0.5, False, np.zeros(len(time)))
        report.jitter = max(report.jitter, used)
        origin = float(time[0]) if report.first is None else report.first
        known = time if report.last is None else np.concatenate([[report.last], time])
        parts, before = [], report.last
        jumps = np.flatnonzero(np.diff(known) > self._bridged * period)
        for at in [*jumps, len(known) - 1]:
            end = float(known[at])
            parts.append(_times(origin, period, before, end))
            if at < len(known) - 1:
                reach = min(float(known[at + 1]), end + self._most * period)
                parts.append(_times(origin, period, end, reach, False))
                before = float(known[at + 1]) - 2.0 * _ROUNDING * period
        return _snapped(np.concatenate(parts), known, _ROUNDING * period)


def first_known(values: Array, begins: NDArray[np.int_]) -> Array:
    """The first number in each column of each group of rows, nan where there is none."""
    rows = np.arange(len(values))[:, None]
    known = np.minimum.reduceat(np.where(np.isfinite(values), rows, len(values)), begins)
    first = np.where(known < len(values), known, begins[:, None])
    return np.take_along_axis(values, first, axis=0)


def _times(
    origin: float, period: float, after: float | None, last: float, closed: bool = True
) -> Array:
    """The multiples of the period from the origin on, after one time and up to another."""
    first = 0 if after is None else int(np.floor((after - origin) / period)) - 1
    steps = np.arange(max(first, 0), int((last - origin) / period) + 2, dtype=np.float64)
    times = origin + period * steps
    inside = times <= last + _ROUNDING * period if closed else times < last - _ROUNDING * period
    if after is not None:
        inside &= times > after + _ROUNDING * period
    chosen: Array = times[inside]
    return chosen


def _snapped(times: Array, samples: Array, rounding: float) -> Array:
    """Times, or the samples that they are equal to but for rounding."""
    at = np.clip(np.searchsorted(samples, times), 1, max(len(samples) - 1, 1))
    for near in (samples[at - 1], samples[np.minimum(at, len(samples) - 1)]):
        times = np.where(np.abs(times - near) <= rounding, near, times)
    return times
