"""Estimation error of a fault, and the part of the run over which it is measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError
from reobserve_papers.metrics.responses import (
    check_windows,
    peak,
    root_mean_square_of_steps,
    scored,
    window,
)
from reobserve_papers.papers.ilo import keys
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]


def _mean_absolute(start: Array, end: Array) -> float:
    """Mean absolute value of a signal from its limits inside each step (trapezoidal rule)."""
    return float(np.mean(np.abs(start) + np.abs(end)) / 2)


# Sizes of a signal from its limits inside each step.
NORMS: Mapping[str, Callable[[Array, Array], float]] = {
    "rms": root_mean_square_of_steps,
    "absolute": _mean_absolute,
    "largest": peak,
}


@dataclass(frozen=True)
class Errors:
    """Fault and estimation error e = u_f - v on one axis, step by step.

    ``start`` and ``end`` [N m] are the limits of e from inside each step, ``fault_start`` and
    ``fault_end`` those of u_f. ``time`` [s] is the start of each step. All have shape (n,).
    """

    time: Array
    start: Array
    end: Array
    fault_start: Array
    fault_end: Array

    def window(self, first: float, last: float = np.inf) -> Errors:
        """The steps that start at ``first`` or later and before ``last``."""
        return self.of_steps(window(self.time, first, last))

    def scored(self, key: str, first: float) -> Errors:
        """The steps that start at ``first`` or later, of which there must be some, by that key."""
        return self.of_steps(scored(key, self.time, first, np.inf))

    def of_steps(self, chosen: NDArray[np.bool_]) -> Errors:
        """The chosen steps."""
        return Errors(*(getattr(self, part.name)[chosen] for part in fields(self)))

    @property
    def root_mean_square(self) -> float:
        """Root mean square of e [N m]."""
        return root_mean_square_of_steps(self.start, self.end)

    @property
    def relative_root_mean_square(self) -> float:
        """Root mean square of e over that of u_f."""
        return self.relative("rms")

    def relative(self, norm: str) -> float:
        """|e| over |u_f|, both measured by one of `NORMS`."""
        size = NORMS[norm]
        return size(self.start, self.end) / size(self.fault_start, self.fault_end)

    @property
    def mean_fault(self) -> float:
        """Mean of u_f over time [N m]."""
        return float(np.mean(self.fault_start + self.fault_end) / 2)

    def guessed(self, constant: float) -> Errors:
        """The errors of an estimate that is always ``constant`` [N m]."""
        start, end = self.fault_start - constant, self.fault_end - constant
        return replace(self, start=start, end=end)

    @classmethod
    def of(cls, plant: Series, estimate: Series, axis: int) -> Errors:
        """Compute them from a plant record and an estimate at every n-th of its rows."""
        every = round(estimate.step / plant.step)

        def limits(series: Series, stride: int) -> tuple[Array, Array]:
            right = series["fault"][::stride, axis]
            twin = "fault_before" if "fault_before" in series.channels else "fault"
            return right[:-1], series[twin][::stride, axis][1:]

        fault_start, fault_end = limits(plant, every)
        start, end = limits(estimate, 1)
        return cls(estimate.time[:-1], fault_start - start, fault_end - end, fault_start, fault_end)


def check_rules(rules: keys.Metrics, horizon: float, step: float) -> None:
    """Refuse windows that hold no step of a plant's record, which may be two of it."""
    windows = {
        "settling_skip": (rules.settling_skip, horizon),
        "late_window": (max(0.0, horizon - rules.late_window), horizon),
    }
    check_windows(windows, horizon, 2.0 * step)


def scored_errors(
    job: keys.Job, plant: Series, estimate: Series, skip: float | None = None
) -> Errors:
    """Errors on the faulty axis from the first onset on, as used in the metrics of figures.

    The ``skip`` seconds after each onset are left out, by default ``metrics.settling_skip``.
    """
    skip = job.metrics.settling_skip if skip is None else skip
    errors = Errors.of(plant, estimate, job.metrics.axis - 1)
    onsets = plant.events["onsets"] or (0.0,)
    keep = errors.time > onsets[0] - 1e-9
    for onset in onsets:
        skipped = onset + skip
        keep &= (errors.time < onset - 1e-9) | (errors.time > skipped - 1e-9)
    if not keep.any():
        problem = f"{skip:g} s after each onset leave no step to be scored"
        raise InputError("metrics.settling_skip", problem)
    return errors.of_steps(keep)
