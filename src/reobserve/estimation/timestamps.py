"""Timestamps: the place of each row on the grid of sampling periods, and the rows that are lost.

A row is accepted if some grid has it, and all rows before it, no farther than ``jitter`` periods
from their places. The times at which the latest place of such a grid may be are an interval:

    [low, high] = [low + n T - s, high + n T + s] and [t - j T, t + j T]

of a row that is stamped t, n periods T after the one before. The grid moves by s with the logger's
clock: by no more than a thousandth of a period in each, and of a hundredth where rows are lost.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.core.kernel import kernel
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.specification import Sampling
from reobserve.estimation.text_rows import RowError

Array = NDArray[np.float64]

MOST_SLOTS = 1_000_000  # in one gap
_LOOKED_AT = 20  # intervals, before the period is checked
_WRONG = 0.25  # how far their median may be off, which jitter moves by less
_DRIFT, _DRIFT_IN_GAP = 1e-3, 1e-2  # of a clock, in periods a period


class UnevenError(RowError):
    """Timestamps that are farther from their places than ``sampling.jitter``.

    Parameters
    ----------
    found
        Which row is how far off, as the beginning of a sentence, with ``{at}`` for the ``row``.
    least
        The jitter that would accept the rows ``among``; None if no jitter would.
    """

    def __init__(self, found: str, row: int, least: float | None, among: str) -> None:
        self.found = found
        accepting = (
            f"no jitter below 0.5 accepts {among}" if least is None else
            f"if samples are taken on time and stamped late, {least:.2g} accepts {among}"
        )  # fmt: skip
        super().__init__(
            "sampling.jitter",
            f"{found}; {accepting}; if they are taken when their timestamps say, sampling.uneven: "
            "linear, previous or pchip resamples them",
            row,
        )


@kernel
def _placed(
    time: Array, grid: Array, period: float, jitter: float, refuse: bool, passed: Array
) -> tuple[int, float]:
    """The number of accepted rows, and the maximum jitter. It fills the periods ``passed`` by each.

    ``grid`` is [low, high], nan before the first row; the rows go on from it.
    """
    low, high, greatest = grid[0], grid[1], 0.0
    reach = jitter * period
    for k in range(len(time)):
        t = time[k]
        if np.isnan(low):
            low, high = t - reach, t + reach
            continue
        n = max(np.rint((t - 0.5 * (low + high)) / period), 1.0)
        slack = _DRIFT * period
        # A row that can be the next one is the next one: the first place is not known exactly.
        if n == 2.0 and t - reach <= high + period + slack:
            n = 1.0
        if n > 1.0:
            slack = _DRIFT_IN_GAP * n * period
        below = max(low + n * period - slack, t - reach)
        above = min(high + n * period + slack, t + reach)
        used = jitter + 0.5 * (below - above) / period
        if below > above:
            if refuse:
                passed[k] = n
                grid[0], grid[1] = low + n * period, high + n * period
                return k, used
            below, above, used = t - reach, t + reach, 0.5
        low, high, greatest = below, above, max(greatest, used)
        passed[k] = n
    grid[0], grid[1] = low, high
    return len(time), greatest


def least_jitter(blocks: Iterable[Array], period: float) -> tuple[float | None, float | None]:
    """The minimum jitter, in hundredths of a period, that accepts timestamps, or None if none does.

    Then also their mean interval [s], if it differs from the period by more than rounding.
    """
    grids = {share / 100: np.full(2, np.nan) for share in range(1, 50)}
    count, total, squares, last = 0, 0.0, 0.0, np.empty(0)
    for block in blocks:
        time = block[np.isfinite(block)]
        passed = np.zeros(len(time))
        for jitter, grid in list(grids.items()):
            if _placed(time, grid, period, jitter, True, passed)[0] < len(time):
                del grids[jitter]
        steps = np.diff(np.concatenate([last, time])) / period
        last = time[-1:] if len(time) else last
        off = steps[steps < 1.9] - 1.0  # where no row was lost
        count, total, squares = count + len(off), total + off.sum(), squares + (off**2).sum()
    if grids or not count:
        return min(grids, default=None), None
    mean = total / count
    unsure = 3.0 * np.sqrt(max(squares / count - mean**2, 0.0) / count)
    return None, period * (1.0 + mean) if abs(mean) > _DRIFT + unsure else None


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
    begun: list[float] = field(default_factory=list)  # the first intervals
    grid: Array = field(default_factory=lambda: np.full(2, np.nan))

    @property
    def _bridged(self) -> int:
        """The number of slots of a gap that are worth having."""
        return int(min(self.sampling.longest / self.sampling.period, MOST_SLOTS)) + 2

    def read(self, time: Array, values: Array) -> tuple[Array, Array, Array]:
        """The rows to use, their timestamps first, and the times of the slots up to the last.

        Raises
        ------
        InputError
            If timestamps go back or, where this is refused, are uneven, repeated or missing.
        """
        report, sampling = self.report, self.sampling
        rows, report.rows = report.rows, report.rows + len(time)
        even = sampling.uneven == "refuse"
        if np.isnan(time).any():
            known = ~np.isnan(time)
            if even:
                row = rows + int(np.argmin(known)) + 1
                raise RowError(self.place, "{at} has no timestamp", row)
            report.unstamped += int((~known).sum())
            time, values = time[known], values[known]
        if not len(time):
            return time, values, time
        begin = [] if report.last is None else [report.last]
        steps = np.diff(np.concatenate([begin, time]))
        if (steps < 0).any() or (even and (steps == 0).any()):
            self._refuse(steps, time, rows)
        if (steps == 0).any():
            kept = np.concatenate([[True] * (1 - len(begin)), steps > 0]).astype(bool)
            report.repeated += int((~kept).sum())
            time, values, steps = time[kept], values[kept], steps[steps > 0]
            if not len(time):
                return time, values, time
        self._look(steps)
        slots = self._even(steps, time, rows) if even else self._regular(time, steps)
        if report.first is None:
            report.first = float(time[0])
        report.last = float(time[-1])
        return time, values, slots

    def _refuse(self, steps: Array, time: Array, rows: int) -> None:
        at = int(np.argmax(steps <= 0)) + len(time) - len(steps)
        now, said = float(time[at]), "goes back" if steps.min() < 0 else "stands still"
        hint = "" if self.report.origin is None else "; a date without an offset is one of UTC"
        problem = f"{{at}}: the timestamp {said}, at {now:.9g} s{hint}"
        raise RowError(self.place, problem, rows + at + 1)

    def _look(self, steps: Array) -> None:
        """Check the period once there are enough intervals."""
        missing = _LOOKED_AT - len(self.begun)
        if missing > 0 and len(steps):
            self.begun += steps[:missing].tolist()
            if len(self.begun) == _LOOKED_AT:
                self.check_period()

    def check_period(self) -> None:
        """Refuse a period that is not that of the timestamps.

        Raises
        ------
        InputError
            If the median of the first intervals is more than a quarter shorter or longer; where
            rows are resampled, more than ten times.
        """
        if not self.begun:
            return
        median, period = float(np.median(self.begun)), self.sampling.period
        ratio = median / period
        even = self.sampling.uneven == "refuse"
        if abs(ratio - 1.0) > _WRONG if even else not 0.1 <= ratio <= 10.0:
            raise InputError(
                "sampling.period",
                f"{period:g} s disagrees with the timestamps of {self.place}, which go on by "
                f"{median:.6g} s (the median of the first {len(self.begun)} intervals)",
            )

    def follows(self, time: float) -> bool:
        """Take a timestamp if it is in its place, a period after the one before."""
        grid, passed, sampling = self.grid.copy(), np.zeros(1), self.sampling
        accepted, used = _placed(
            np.array([time]), grid, sampling.period, sampling.jitter, True, passed
        )
        if accepted == 0 or passed[0] != 1.0:
            return False
        self.grid[:], self.report.jitter = grid, max(self.report.jitter, used)
        return True

    def _even(self, steps: Array, time: Array, rows: int) -> Array:
        report, period, jitter = self.report, self.sampling.period, self.sampling.jitter
        passed = np.zeros(len(time))
        accepted, used = _placed(time, self.grid, period, jitter, True, passed)
        if accepted < len(time):
            if len(self.begun) == _LOOKED_AT:
                self.check_period()
            off = (time[accepted] - 0.5 * float(self.grid.sum())) / period
            least = np.ceil(100.0 * used - 1e-6) / 100.0
            raise UnevenError(
                f"{jitter:g} is exceeded in {{at}} of {self.place}: its timestamp, "
                f"{time[accepted]:.14g} s, is {off:.2g} sampling periods of {period:g} s off its "
                "place", rows + accepted + 1,
                float(least) if least < 0.5 else None, "the rows up to there",
            )  # fmt: skip
        report.jitter = max(report.jitter, used)
        passed = passed[len(time) - len(steps) :]
        self._count(passed)
        if not (passed > 1.0).any():
            return time
        starts = time if report.last is None else np.concatenate([[report.last], time])
        first = len(time) - len(steps)  # the row that the first step leads to
        parts, done = [], 0
        for k in np.flatnonzero(passed > 1.0).tolist():
            self._check_coast(passed[k], starts[k])
            inside = np.arange(1, min(passed[k], self._most(passed[k])))
            parts += [time[done : k + first], starts[k] + steps[k] * (inside / passed[k])]
            done = k + first
        parts.append(time[done:])
        return np.concatenate(parts)

    def _count(self, passed: Array) -> None:
        self.report.intervals += len(passed)
        self.report.lost += int(passed.sum()) - len(passed)

    def _most(self, count: float) -> float:
        return count if self.sampling.at_gap == "coast" else float(self._bridged)

    def _check_coast(self, count: float, start: float) -> None:
        if self.sampling.at_gap == "coast" and count > MOST_SLOTS:
            raise InputError(
                self.place,
                f"the gap after {start:.9g} s is of {count:.0f} sampling periods, no more than "
                f"{MOST_SLOTS} are coasted over",
            )

    def _regular(self, time: Array, steps: Array) -> Array:
        """The times t0 + k T up to the last timestamp."""
        report, period = self.report, self.sampling.period
        report.intervals += len(steps)
        _, used = _placed(time, self.grid, period, 0.5, False, np.zeros(len(time)))
        report.jitter = max(report.jitter, used)
        origin = float(time[0]) if report.first is None else report.first
        known = time if report.last is None else np.concatenate([[report.last], time])
        parts, before = [], report.last
        jumps = np.flatnonzero(np.diff(known) > self._bridged * period)
        for at in [*jumps, len(known) - 1]:
            end = float(known[at])
            parts.append(_times(origin, period, before, end))
            if at < len(known) - 1:
                count = float(known[at + 1] - end) / period
                self._check_coast(count, end)
                reach = min(float(known[at + 1]), end + self._most(count) * period)
                parts.append(_times(origin, period, end, reach, False))
                before = float(np.nextafter(known[at + 1], -np.inf))
        return np.concatenate(parts)


def _times(
    origin: float, period: float, after: float | None, last: float, closed: bool = True
) -> Array:
    """The multiples of the period from the origin on, after one time and up to another."""
    first = 0 if after is None else int(np.floor((after - origin) / period)) - 1
    steps = np.arange(max(first, 0), int((last - origin) / period) + 2, dtype=np.float64)
    times = origin + period * steps
    inside = times <= last if closed else times < last
    if after is not None:
        inside &= times > after
    found: Array = times[inside]
    return found
