"""The estimation error of a fault, and the part of the run over which it is scored."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reobserve.timeseries.series import Series

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Errors:
    """Fault and estimation error e = u_f - v on one axis, step by step.

    ``start`` and ``end`` [N m] are the limits from inside each step, ``fault_start`` and
    ``fault_end`` those of u_f; ``time`` [s] is that of the steps' starts, all of shape (n,).
    """

    time: Array
    start: Array
    end: Array
    fault_start: Array
    fault_end: Array

    def window(self, first: float, last: float = np.inf) -> Errors:
        """The steps that start at ``first`` or later and before ``last``."""
        keep = (self.time > first - 1e-9) & (self.time < last - 1e-9)
        return Errors(
            self.time[keep],
            self.start[keep],
            self.end[keep],
            self.fault_start[keep],
            self.fault_end[keep],
        )

    @classmethod
    def of(cls, plant: Series, estimate: Series, axis: int) -> Errors:
        """From a plant record and an estimate sampled at every so many of its rows."""
        every = round(estimate.step / plant.step)

        def limits(series: Series, stride: int) -> tuple[Array, Array]:
            right = series["fault"][::stride, axis]
            twin = "fault_before" if "fault_before" in series.channels else "fault"
            return right[:-1], series[twin][::stride, axis][1:]

        fault_start, fault_end = limits(plant, every)
        start, end = limits(estimate, 1)
        return cls(estimate.time[:-1], fault_start - start, fault_end - end, fault_start, fault_end)


def scored(errors: Errors, onsets: Sequence[float], skip: float) -> Errors:
    """The errors from ``skip`` seconds after the last onset on, and between earlier ones."""
    keep = errors.time > (onsets[0] if onsets else 0.0) - 1e-9
    for onset in onsets or (0.0,):
        keep &= (errors.time < onset - 1e-9) | (errors.time > onset + skip - 1e-9)
    return Errors(
        errors.time[keep],
        errors.start[keep],
        errors.end[keep],
        errors.fault_start[keep],
        errors.fault_end[keep],
    )
