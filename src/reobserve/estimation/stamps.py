"""Where rows stand in time: a slot for each sampling period, those of lost rows among them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve.estimation.account import Account
from reobserve.estimation.specification import Sampling

Array = NDArray[np.float64]

MOST_SLOTS = 1_000_000  # in one gap
_LOOKED_AT = 20  # intervals, before the period is judged


@dataclass
class Stamps:
    """Reads the stamps of rows, in order, and says at which times there is to be a sample.

    With ``uneven: refuse`` those are the stamps, and times evenly between two of them where rows
    were lost; else times a sampling period apart from the first stamp on. Of a gap that no policy
    bridges only the first slots are given.
    """

    sampling: Sampling
    account: Account
    place: str
    begun: list[float] = field(default_factory=list)  # the first intervals

    @property
    def _bridged(self) -> int:
        """How many slots of a gap are worth having."""
        return int(min(self.sampling.longest / self.sampling.period, MOST_SLOTS)) + 2

    def read(self, time: Array, values: Array) -> tuple[Array, Array, Array]:
        """The rows to use, their stamps first, and the times of the slots up to the last of them.

        Raises
        ------
        InputError
            If stamps go back or, where this is refused, are uneven, repeated or missing.
        """
        account, sampling = self.account, self.sampling
        rows, account.rows = account.rows, account.rows + len(time)
        even = sampling.uneven == "refuse"
        if np.isnan(time).any():
            known = ~np.isnan(time)
            if even:
                row = rows + int(np.argmin(known)) + 1
                raise InputError(self.place, f"row {row} has no stamp")
            account.unstamped += int((~known).sum())
            time, values = time[known], values[known]
        if not len(time):
            return time, values, time
        begin = [] if account.last is None else [account.last]
        steps = np.diff(np.concatenate([begin, time]))
        if (steps < 0).any() or (even and (steps == 0).any()):
            self._refuse(steps, time, rows)
        if (steps == 0).any():
            kept = np.concatenate([[True] * (1 - len(begin)), steps > 0]).astype(bool)
            account.repeated += int((~kept).sum())
            time, values, steps = time[kept], values[kept], steps[steps > 0]
            if not len(time):
                return time, values, time
        self._look(steps)
        slots = self._even(steps, time, rows) if even else self._regular(time, steps)
        if account.first is None:
            account.first = float(time[0])
        account.last = float(time[-1])
        return time, values, slots

    def _refuse(self, steps: Array, time: Array, rows: int) -> None:
        at = int(np.argmax(steps <= 0)) + len(time) - len(steps)
        now, said = float(time[at]), "goes back" if steps.min() < 0 else "stands still"
        hint = "" if self.account.origin is None else "; a date without an offset is one of UTC"
        problem = f"row {rows + at + 1}: the stamp {said}, at {now:.9g} s{hint}"
        raise InputError(self.place, problem)

    def _look(self, steps: Array) -> None:
        """Judge the period once there are enough intervals."""
        missing = _LOOKED_AT - len(self.begun)
        if missing > 0 and len(steps):
            self.begun += steps[:missing].tolist()
            if len(self.begun) == _LOOKED_AT:
                self.judge()

    def judge(self) -> None:
        """Refuse a period that is not that of the stamps.

        Raises
        ------
        InputError
            If the median of the first intervals is another, where rows are not resampled; or if
            it is more than ten times shorter or longer.
        """
        if not self.begun:
            return
        median, period = float(np.median(self.begun)), self.sampling.period
        ratio = median / period
        even = self.sampling.uneven == "refuse"
        if abs(ratio - 1.0) > self.sampling.jitter if even else not 0.1 <= ratio <= 10.0:
            raise InputError(
                "sampling.period",
                f"{period:g} s disagrees with the stamps of {self.place}, which go on by "
                f"{median:.6g} s (the median of the first {len(self.begun)} intervals)",
            )

    def _even(self, steps: Array, time: Array, rows: int) -> Array:
        account, period = self.account, self.sampling.period
        passed = np.rint(steps / period)
        off = np.abs(steps - passed * period)
        wrong = (off > self.sampling.jitter * period * np.maximum(passed, 1.0)) | (passed < 1.0)
        if wrong.any():
            self.judge()
            at = int(np.argmax(wrong))
            row = at + len(time) - len(steps)
            raise InputError(
                self.place,
                f"row {rows + row + 1}: the stamp goes on by {steps[at]:.6g} s to {time[row]:.14g} "
                f"s, which is {steps[at] / period:.4g} sampling periods of {period:g} s; with "
                "sampling.uneven: linear, previous or pchip the record is resampled",
            )
        if len(steps):
            account.jitter = max(account.jitter, float((off / (passed * period)).max()))
        self._count(passed)
        if not (passed > 1.0).any():
            return time
        starts = time if account.last is None else np.concatenate([[account.last], time])
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
        self.account.intervals += len(passed)
        self.account.lost += int(passed.sum()) - len(passed)

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
        """The times t0 + k T up to the last stamp."""
        account, period = self.account, self.sampling.period
        account.intervals += len(steps)
        if len(steps):
            off = np.abs(steps / period - np.maximum(np.rint(steps / period), 1.0))
            account.jitter = max(account.jitter, float(off.max()))
        origin = float(time[0]) if account.first is None else account.first
        known = time if account.last is None else np.concatenate([[account.last], time])
        parts, before = [], account.last
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
