"""Warnings about estimates that mislead, by criteria computed on the longest stretch of a record.

It is the longest one among the first rows in which the observer does not restart.

The size of an estimate is the root mean square of the largest of its components in that unit. Of a
state or a signal that follows a constant added to the measurements the zero is that of a scale:
its size is the spread about its mean, or twice what noise of the measurements would shift it.

Noise: its size on each measurement is taken from second differences, in which what is smooth
cancels. The observer runs over the same rows again with noise of this size added, from a fixed
seed; where an estimate then moves, in the root mean square over the second half, by more than half
of its size, most of what is seen in it is noise. An unknown input or a fault is zero when all is
well, so it is compared with the threshold of its alarm, and with nothing if it has none.

Excitation: an observer of a delay that switches itself off for want of it does so all the time.

Settling: the observer starts a second time, as after a gap, in the middle of the rows. Where the
two runs are at the end still apart by more than a twentieth of the estimate's size, and by more
than three times what noise does, the record is too short to forget how it began.

Consistency: a residual is compared with the spread of what is measured about its mean: it
contradicts the model if it is, in the root mean square over the second half, more than half of
that, more than five times the noise, and does not die away (more than a hundredth of its maximum is
left). Smaller misfits of a filter are found by `reobserve.estimation.consistency`, over all of the
rows.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, ReobserveError
from reobserve.core.units import angles, readings
from reobserve.estimation.consistency import Statistic, statistics
from reobserve.estimation.gaps import Stretch, joined
from reobserve.estimation.output_columns import RESIDUAL
from reobserve.estimation.quantities import conversion

if TYPE_CHECKING:
    from reobserve.estimation.estimate import Estimation

Array = NDArray[np.float64]

MOST_ROWS = 4000  # of a stretch that are kept
_LOOKED_AT = 10 * MOST_ROWS  # of a record
_LEAST_ROWS = 40
_SHARE_OF_NOISE = 0.5
_APART = 0.05
_SPREADS = 5.0
_SHARE_UNFORESEEN = 0.5
_LEFT = 0.01
_ROUNDING = 1e-9  # of a size about zero
_FOLLOWS = 1e-4  # of the spread of an estimate
# Estimates that are zero when all is well.
_FAULTS = ("unknown_input", "fault", "fault_rate", "actuator_fault", "sensor_fault")
_LEVELS = ("state", "derivatives")  # estimates that may have the zero of a measurement
_SEED = 20
_SAID = {"autocorrelation": "lag-1 autocorrelation", "mean": "mean in standard deviations"}


@dataclass
class FirstRows:
    """The first rows of a record, in lists of stretches from start to start of the observer."""

    runs: list[list[Stretch]] = field(default_factory=list)
    rows: int = 0

    def take(self, stretch: Stretch) -> None:
        """Keep rows as long as they are among the first."""
        if (count := _LOOKED_AT - self.rows) > 0:
            time, y, u, status, fresh = stretch
            self.runs += [[]] if fresh else []
            kept = Stretch(time[:count], y[:count], u[:count], status[:count], fresh)
            self.runs[-1].append(kept)
        self.rows += len(stretch.y)

    def longest(self) -> tuple[Array, Array]:
        """Measurements and inputs of the longest run, as far as they are looked at."""
        lengths = [min(sum(len(one.y) for one in run), MOST_ROWS) for run in self.runs]
        if not any(lengths):
            return np.empty((0, 0)), np.empty((0, 0))
        _, y, u, _, _ = joined(self.runs[lengths.index(max(lengths))])
        return y[:MOST_ROWS], u[:MOST_ROWS]


def diagnostics(estimation: Estimation, first_rows: FirstRows) -> list[str]:
    """Sentences on what would mislead in these results, or none if nothing does."""
    y, u = first_rows.longest()
    rows = len(y)
    if rows < _LEAST_ROWS:
        text = f"too few rows to check noise or settling: {rows} in the longest stretch"
        return [text] if rows else []
    where = f"the {rows} rows of the longest stretch" if estimation.report.restarts else ""
    where = where or f"the first {rows} rows"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = _run(estimation, y, u)
            whole = estimation.outputs.numbers(y, run.estimates)
            later = _columns(estimation, y[len(y) // 2 :], u[len(u) // 2 :])
            noisy = _columns(estimation, y + _noise(y), u)
            risen = np.abs(_columns(estimation, y + _steps(y), u) - whole)
            sentences = _contradicted(estimation, y, run, where)
    except ReobserveError:
        return ["the observer diverges where it starts elsewhere or with more noise"]
    off = [c for c, out in enumerate(estimation.outputs.columns) if out.estimate == "switched_off"]
    if off and whole[1:, off[0]].min() >= 1.0:
        sentences.append(
            f"delay: over 100 % of {where} the input moves too little for it to be "
            "seen, and it stays as it began"
        )
    with np.errstate(over="ignore", invalid="ignore"):  # of measurements near the largest number
        sizes = _sizes(estimation, whole, risen)
        sentences += _unsettled(estimation, whole, later, noisy, sizes, where)
    return sentences


def _sizes(estimation: Estimation, whole: Array, risen: Array) -> dict[tuple[str, str], float]:
    """The size of each estimate in each unit, from what a constant that is added does to it."""
    sizes: dict[tuple[str, str], float] = {}
    for c, column in enumerate(estimation.outputs.columns):
        if column.deviation:
            continue
        size = _size(whole[:, c])
        # An error of the start dies away, a change of the zero stays.
        follows = risen[-1, c] > max(0.5 * risen[:, c].max(), _FOLLOWS * _spread(whole[:, c]))
        if column.estimate in _LEVELS and follows:
            least = max(risen[-1, c] / _SHARE_OF_NOISE, _ROUNDING * size)
            size = max(_spread(whole[:, c]), float(least))
        group = (column.estimate, column.unit)
        sizes[group] = max(sizes.get(group, 0.0), size)
    return sizes


def _unsettled(
    estimation: Estimation, whole: Array, later: Array, noisy: Array,
    sizes: dict[tuple[str, str], float], where: str,
) -> list[str]:  # fmt: skip
    """A sentence for each estimate that noise or an earlier start moves."""
    half = len(later) - len(later) // 2
    sentences: list[str] = []
    for c, column in enumerate(estimation.outputs.columns):
        if column.estimate == RESIDUAL or column.deviation:
            continue
        size = sizes[column.estimate, column.unit]
        moved = float(np.sqrt(np.mean((noisy[-half:, c] - whole[-half:, c]) ** 2)))
        fault = column.estimate in _FAULTS
        large = _threshold(estimation, c) if fault else size
        if moved > _SHARE_OF_NOISE * large:
            what = "the threshold of its alarm" if fault else "its size"
            sentences.append(
                f"{column.name}: noise moves it by {_percent(moved, large)} of {what} over "
                f"{where}; a lower gain, or less process noise, smooths it"
            )
        shift = float(abs(later[-1, c] - whole[-1, c]))
        if shift > max(_APART * size, 3.0 * moved):
            sentences.append(
                f"{column.name}: started again at half of {where}, it ends "
                f"{_percent(shift, size)} of its size elsewhere; the record is too short for it to "
                "settle"
            )
    return sentences


def _threshold(estimation: Estimation, column: int) -> float:
    """The lowest threshold of alarms on a column, but those in its own standard deviations."""
    reports = estimation.report.alarms
    entries = [reports[alarm.rule.name] for alarm in estimation.alarms if alarm.column == column]
    limits = [x for a in entries if a.sigmas is None for x in (a.threshold, a.above, a.below)]
    return min((abs(limit) for limit in limits if limit is not None), default=np.inf)


def _contradicted(estimation: Estimation, y: Array, run: Any, where: str) -> list[str]:
    """A sentence for each measurement that is far from what the observer predicted."""
    design, layout = estimation.design, estimation.layout
    half = len(y) // 2
    residual, noise = design.residual(y, run.estimates), _noise_sizes(y)
    sentences = []
    names = layout.names[layout.timed :][: residual.shape[1]]
    for c, name in enumerate(names):
        off, measured = _size(residual[half:, c]), _spread(y[:, c])
        greatest = np.nanmax(np.abs(residual[:, c]), initial=0.0)
        least = (
            _SHARE_UNFORESEEN * measured, _SPREADS * noise[c], _LEFT * greatest,
            _ROUNDING * _size(y[:, c]),
        )  # fmt: skip
        if off > max(least):
            sentences.append(
                f"residual {name}: it is {_percent(off, measured)} of the spread of what is "
                f"measured in the second half of {where}; a unit, a sign, an offset, the model or "
                "the sensor is wrong, or there is a fault from early on"
            )
    misfit = _misfit(estimation, run.estimates, names, where)
    turns = np.array([_turn(unit) for unit in layout.units[layout.timed :][: y.shape[1]]])
    wraps = bool((np.abs(np.diff(y, axis=0)) > 0.5 * turns).any())
    hint = "; of an angle that wraps, observer.periods states the period, or wrap of its column"
    return [sentence + hint * wraps for sentence in sentences or misfit]


def _misfit(estimation: Estimation, estimates: Any, names: Sequence[str], where: str) -> list[str]:
    """Report the statistics of a filter's innovations: a sentence if they are not of its model."""
    design: Any = estimation.design
    white = getattr(design.observer, "has_kalman_gain", True)
    if design.residual_variance(estimates) is None or not white:
        return []
    said, found = list[str](), estimation.report.innovations
    every: list[Statistic] = []
    with suppress(InputError):  # of covariances that are none, by rounding
        every += list(statistics(estimates["innovation"], estimates["innovation_covariance"]))
    for one in every:
        name = names[one.place]
        if one.name == "nis":
            found["nis"], text = one.value, f"NIS {one.value:.3g} times as large as predicted"
        else:
            found.setdefault(one.name, {})[name] = one.value
            text = f"{_SAID[one.name]} of {name} {one.value:.2g}"
        if not one.fits:
            said.append(f"{text} (bounds {one.lower:.2g} to {one.upper:.2g})")
    if not said:
        return []
    return [
        f"innovations: over {where} they do not fit the filter: {', '.join(said)}; a pole, Q, R, "
        "a unit or an offset is wrong, or there is a fault"
    ]


def _turn(unit: str) -> float:
    """A turn in a unit, infinite if it is none of angles."""
    if not any(angles(each) == 1.0 and each.dimensionless for each in readings(unit)):
        return np.inf
    return 2.0 * np.pi * float(conversion("", "rad", unit).factor)


def _size(values: Array) -> float:
    """The root mean square of what there is, or 0 of nothing."""
    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else 0.0


def _spread(values: Array) -> float:
    """The root mean square about the mean."""
    known = values[np.isfinite(values)]
    return _size(known - np.mean(known)) if len(known) else 0.0


def _steps(y: Array) -> Array:
    """A constant for each measurement: its noise, or a small part of its spread."""
    small = np.array([0.01 * (_spread(signal) or _size(signal) or 1.0) for signal in y.T])
    steps: Array = np.maximum(_noise_sizes(y), small)
    return steps


def _run(estimation: Estimation, y: Array, u: Array) -> Any:
    return estimation.run(y, u, estimation.design.begin(y[0]))


def _columns(estimation: Estimation, y: Array, u: Array) -> Array:
    return estimation.outputs.numbers(y, _run(estimation, y, u).estimates)


def _noise(y: Array) -> Array:
    """Noise like that of the measurements."""
    return np.random.default_rng(_SEED).normal(size=y.shape) * _noise_sizes(y)


def _noise_sizes(y: Array) -> Array:
    """The deviation of each column's noise: of white noise second differences have 6 variances."""
    bends = np.abs(np.diff(y, 2, axis=0))
    bends[~np.isfinite(bends)] = np.nan
    # The median, so that jumps and outliers are no noise; 0.6745 of a deviation.
    return np.asarray(np.nan_to_num(np.nanmedian(bends, axis=0) / 0.6745 / np.sqrt(6.0)))


def _percent(part: float, whole: float) -> str:
    return f"{100 * part / whole:.0f} %" if whole > 0.01 * part else "far more than 100 %"
