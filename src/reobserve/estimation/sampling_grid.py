"""The place of each timestamp on the grid of sampling periods.

A row is accepted if some grid has it, and all rows before it, no farther than ``jitter`` periods
from their places. The times at which the latest place of such a grid may be are an interval:

    [low, high] = [low + n T - s, high + n T + s] and [t - j T, t + j T]

of a row that is stamped t, n periods T after the one before. The grid moves by s with the logger's
clock: by no more than a thousandth of a period in each, and of a hundredth where rows are lost.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from reobserve.core.kernel import kernel
from reobserve.estimation.refusals import RowError

Array = NDArray[np.float64]

_DRIFT, _DRIFT_IN_GAP = 1e-3, 1e-2  # of a clock, in periods a period


RESAMPLING = "sampling.uneven: linear, previous or pchip resamples them"


class UnevenError(RowError):
    """Timestamps that are farther from their places than ``sampling.jitter``.

    Parameters
    ----------
    finding
        Which row is how far off, as the beginning of a sentence, with ``{at}`` for the ``row``.
    least
        The jitter that would accept the rows ``among``; None if no jitter would.
    """

    def __init__(self, finding: str, row: int, least: float | None, among: str) -> None:
        self.finding = finding
        accepting = (
            f"no jitter below 0.5 accepts {among}" if least is None else
            f"if samples are taken on time and stamped late, {least:.2g} accepts {among}"
        )  # fmt: skip
        super().__init__(
            "sampling.jitter",
            f"{finding}; {accepting}; if they are taken when their timestamps say, {RESAMPLING}",
            row,
        )


@kernel
def placed(
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
        before = np.concatenate([last if len(last) else [-np.inf], time])[:-1]
        time = time[time > np.maximum.accumulate(before)]  # not repeated, and not back
        passed = np.zeros(len(time))
        for jitter, grid in list(grids.items()):
            if placed(time, grid, period, jitter, True, passed)[0] < len(time):
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
