"""Warnings about estimates that mislead, by criteria computed on the first rows of a record.

The size of an estimate is the root mean square of the largest of its components in that unit.

Noise: its size on each measurement is taken from second differences, in which what is smooth
cancels. The observer runs over the same rows again with noise of this size added, from a fixed
seed; where an estimate then moves, in the root mean square over the second half, by more than half
of its size, most of what is seen in it is noise.

Excitation: an observer of a delay that switches itself off for want of it does so all the time.

Settling: the observer starts a second time, as after a gap, in the middle of the rows. Where the
two runs are at the end still apart by more than a twentieth of the estimate's size, and by more
than three times what noise does, the record is too short to forget how it began.

Consistency: a filter predicts how far its innovations spread. Where they spread over the second
half, in the root mean square, more than five times as far, the record contradicts the model. Where
an observer predicts no spread, its residual is compared with what is measured: it contradicts the
model if it is more than half of that, more than five times the noise, and does not die away (more
than a hundredth of its maximum is left).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import ReobserveError
from reobserve.estimation.gaps import Stretch
from reobserve.estimation.outputs import RESIDUAL

if TYPE_CHECKING:
    from reobserve.estimation.estimate import Estimation

Array = NDArray[np.float64]

MOST_ROWS = 4000  # of a record that are kept
_LEAST_ROWS = 40
_SHARE_OF_NOISE = 0.5
_APART = 0.05
_SPREADS = 5.0
_SHARE_UNFORESEEN = 0.5
_LEFT = 0.01
_SEED = 20


@dataclass
class FirstRows:
    """The first rows of a record up to a break, however it comes in blocks."""

    y: list[Array] = field(default_factory=list)
    u: list[Array] = field(default_factory=list)
    rows: int = 0
    closed: bool = False

    def take(self, stretch: Stretch) -> None:
        """Keep rows as long as they are the first ones."""
        if self.closed or (stretch.fresh and self.rows):
            self.closed = True
            return
        left = MOST_ROWS - self.rows
        self.y.append(stretch.y[:left])
        self.u.append(stretch.u[:left])
        self.rows += len(self.y[-1])
        self.closed = self.rows >= MOST_ROWS


def diagnostics(estimation: Estimation, first_rows: FirstRows) -> list[str]:
    """Sentences on what would mislead in these results, or none if nothing does."""
    if first_rows.rows < _LEAST_ROWS:
        text = f"too few rows to check noise or settling: {first_rows.rows} in the first stretch"
        return [text] if first_rows.rows else []
    y, u = np.concatenate(first_rows.y), np.concatenate(first_rows.u)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = _run(estimation, y, u)
            whole = estimation.outputs.numbers(y, run.estimates)
            later = _columns(estimation, y[len(y) // 2 :], u[len(u) // 2 :])
            noisy = _columns(estimation, y + _noise(y), u)
            found = _contradicted(estimation, y, run)
    except ReobserveError:
        return ["the observer diverges where it starts elsewhere or with more noise"]
    off = [c for c, one in enumerate(estimation.outputs.columns) if one.estimate == "switched_off"]
    if off and whole[1:, off[0]].min() >= 1.0:
        found.append(
            f"delay: over 100 % of the first {len(y)} rows the input moves too little for it to be "
            "seen, and it stays as it began"
        )
    with np.errstate(over="ignore", invalid="ignore"):  # of measurements near the largest number
        found += _unsettled(estimation, whole, later, noisy, len(y))
    return found


def _unsettled(
    estimation: Estimation, whole: Array, later: Array, noisy: Array, rows: int
) -> list[str]:
    """A sentence for each estimate that noise or an earlier start moves."""
    half = len(later) - len(later) // 2
    columns = estimation.outputs.columns
    found: list[str] = []
    sizes: dict[tuple[str, str], float] = {}
    for c, column in enumerate(columns):
        group = (column.estimate, column.unit)
        size = float(np.sqrt(np.mean(whole[:, c] ** 2)))
        sizes[group] = max(sizes.get(group, 0.0), 0.0 if column.deviation else size)
    for c, column in enumerate(columns):
        if column.estimate == RESIDUAL or column.deviation:
            continue
        size = sizes[column.estimate, column.unit]
        moved = float(np.sqrt(np.mean((noisy[-half:, c] - whole[-half:, c]) ** 2)))
        if moved > _SHARE_OF_NOISE * size:
            found.append(
                f"{column.name}: noise moves it by {_percent(moved, size)} of its size over the "
                f"first {rows} rows; a lower gain, or less process noise, smooths it"
            )
        apart = float(abs(later[-1, c] - whole[-1, c]))
        if apart > max(_APART * size, 3.0 * moved):
            found.append(
                f"{column.name}: started again at half of the first {rows} rows, it ends "
                f"{_percent(apart, size)} of its size elsewhere; the record is too short for it to "
                "settle"
            )
    return found


def _contradicted(estimation: Estimation, y: Array, run: Any) -> list[str]:
    """A sentence for each measurement that is far from what the observer predicted."""
    design, layout = estimation.design, estimation.layout
    half = len(y) // 2
    residual, noise = design.residual(y, run.estimates), _noise_sizes(y)
    spread = design.spread(run.state)
    found = []
    names = layout.names[layout.timed :][: residual.shape[1]]
    for c, name in enumerate(names):
        off = _size(residual[half:, c])
        if spread is not None:
            contradicted = off > _SPREADS * spread[c]
            than = f"{off / spread[c]:.0f} times what the filter predicts"
        else:
            measured = _size(y[half:, c])
            greatest = np.nanmax(np.abs(residual[:, c]), initial=0.0)
            least = (_SHARE_UNFORESEEN * measured, _SPREADS * noise[c], _LEFT * greatest)
            contradicted = off > max(least)
            than = f"{_percent(off, measured)} of what is measured"
        if contradicted:
            found.append(
                f"residual {name}: it is {than} in the second half of the first {len(y)} rows; a "
                "unit, a sign, an offset, the model or the sensor is wrong, or there is a fault "
                "from early on"
            )
    return found


def _size(values: Array) -> float:
    """The root mean square of what there is, or 0 of nothing."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else 0.0


def _run(estimation: Estimation, y: Array, u: Array) -> Any:
    return estimation.run(y, u, estimation.design.begin(y[0]))


def _columns(estimation: Estimation, y: Array, u: Array) -> Array:
    return estimation.outputs.numbers(y, _run(estimation, y, u).estimates)


def _noise(y: Array) -> Array:
    """Noise like that of the measurements."""
    return np.random.default_rng(_SEED).normal(size=y.shape) * _noise_sizes(y)


def _noise_sizes(y: Array) -> Array:
    """The deviation of each column's noise: of white noise second differences have 6 variances."""
    sizes = np.zeros(y.shape[1])
    for c in range(y.shape[1]):
        bends = np.diff(y[:, c], 2)
        bends = bends[np.isfinite(bends)]
        # The median, so that jumps and outliers are no noise; 0.6745 of a deviation.
        if len(bends):
            sizes[c] = float(np.median(np.abs(bends))) / 0.6745 / np.sqrt(6.0)
    return sizes


def _percent(part: float, whole: float) -> str:
    return f"{100 * part / whole:.0f} %" if whole > 0.01 * part else "far more than 100 %"
