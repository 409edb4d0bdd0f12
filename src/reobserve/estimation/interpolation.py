"""Values between samples: each column from its own samples, as soon as these settle it.

However a record is cut into blocks, the values are bitwise identical: a value depends on the
samples beside it (for pchip on two on each side), and is given when no later row can change it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_ROUNDING = 1.0 + 1e-9
_NEAR = 1e-6  # periods that are rounding, where values are held


class Settled(NamedTuple):
    """Times, shape (k,), the values there, (k, c), and which of these were no samples."""

    time: Array
    values: Array
    between: Flags


@dataclass
class Interpolation:
    """Fills what lies between samples that are not farther apart than ``reach`` [s].

    Parameters
    ----------
    method
        ``linear``, ``previous`` or ``pchip``, for the columns that are not ``held``.
    held
        The columns that keep their last value, for ``hold`` [s].
    period
        Of rows that are resampled [s], or zero. A row is measured, and not filled, if a sample is
        no farther from it than half a period, or, where values are held, was taken within one.
        The value of a column that is held is its mean over the period that begins with the row.
    """

    method: str
    reach: float
    hold: float
    held: tuple[bool, ...]
    period: float = 0.0
    time: Array = field(default_factory=lambda: np.empty(0))
    values: Array = field(init=False)
    asked: Array = field(default_factory=lambda: np.empty(0))
    kept: Array = field(init=False)  # of each column the last sample and its time

    def __post_init__(self) -> None:
        self.values = np.empty((0, len(self.held)))
        self.kept = np.full((2, len(self.held)), np.nan)

    def feed(self, time: Array, values: Array, asked: Array) -> Settled:
        """Take rows, and times up to the last of them at which values are asked for."""
        whole = not len(self.asked) and len(asked) == len(time) and np.array_equal(asked, time)
        self.time = np.concatenate([self.time, time])
        self.values = np.concatenate([self.values, values])
        if whole and not (self.period and any(self.held)) and np.isfinite(values).all():
            self._forget(time[-1:] if len(time) else time)
            return Settled(time, values, np.zeros(values.shape, dtype=bool))
        self.asked = np.concatenate([self.asked, asked])
        return self._settle(self.time[-1] if len(self.time) else -np.inf)

    def finish(self) -> Settled:
        """Give the rows that wait for samples that will not come."""
        return self._settle(np.inf)

    def _settle(self, latest: float) -> Settled:
        columns = len(self.held)
        known = [np.flatnonzero(np.isfinite(self.values[:, c])) for c in range(columns)]
        horizon = min(self._horizon(c, known[c], latest) for c in range(columns))
        count = int(np.searchsorted(self.asked, horizon, side="right"))
        asked, self.asked = self.asked[:count], self.asked[count:]
        values = np.empty((count, columns))
        between = np.empty((count, columns), dtype=bool)
        for c in range(columns):
            values[:, c], between[:, c] = self._column(c, known[c], asked)
        self._forget(asked[-1:])
        return Settled(asked, values, between)

    def _horizon(self, c: int, known: NDArray[np.int_], latest: float) -> float:
        """The time up to which no later row can change a column."""
        if self.held[c]:
            return latest - self.period * (1.0 - _NEAR)
        steady = self.method == "previous" or not len(known)
        if steady or latest - self.time[known[-1]] > self.reach * _ROUNDING:
            return latest
        if self.method == "linear":
            return float(self.time[known[-1]])
        return float(self.time[known[-2]]) if len(known) > 1 else -np.inf

    def _column(self, c: int, known: NDArray[np.int_], asked: Array) -> tuple[Array, Flags]:
        at, values = self.time[known], self.values[known, c]
        if self.held[c] and np.isfinite(self.kept[0, c]):
            at = np.concatenate([self.kept[:1, c], at])
            values = np.concatenate([self.kept[1:, c], values])
        result = np.full(len(asked), np.nan)
        early = _NEAR * self.period if self.held[c] else 0.0
        left = np.searchsorted(at, asked + early, side="right") - 1
        begun = left >= 0
        exact = begun.copy()
        exact[begun] = at[left[begun]] >= asked[begun]
        result[exact] = values[left[exact]]
        if self.held[c] or self.method == "previous":
            limit = self.hold if self.held[c] else self.reach
            open_ = begun & ~exact
            age = asked - at[np.maximum(left, 0)] if len(at) else np.full(len(asked), np.inf)
            open_ &= age <= limit * _ROUNDING
            result[open_] = values[left[open_]]
            if early:
                result += self._later(at, values, asked, left)
            return result, ~exact & ~(open_ & (age * _ROUNDING < self.period))
        inside = begun & ~exact & (left + 1 < len(at))
        start = left[inside]
        near = at[start + 1] - at[start] <= self.reach * _ROUNDING
        inside[inside] = near
        start = start[near]
        if not len(start):
            return result, ~exact
        distance = np.minimum(asked[inside] - at[start], at[start + 1] - asked[inside])
        between = ~exact
        between[inside] = distance > 0.5 * self.period * _ROUNDING
        if self.method == "linear":
            share = (asked[inside] - at[start]) / (at[start + 1] - at[start])
            result[inside] = values[start] + (values[start + 1] - values[start]) * share
        else:
            self._monotone(at, values, asked, inside, result)
        return result, between

    def _later(self, at: Array, values: Array, asked: Array, left: NDArray[np.int_]) -> Array:
        """The mean over a period less the value at its beginning, of values that are held."""
        last = np.searchsorted(at, asked + (1.0 - _NEAR) * self.period) - 1
        counts = np.where(left >= 0, last - left, 0)
        row = np.repeat(np.arange(len(asked)), counts)
        change = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts - left - 1, counts)
        rest = 1.0 - (at[change] - asked[row]) / self.period
        steps = (values[change] - values[change - 1]) * rest
        return np.bincount(row, steps, len(asked)).astype(np.float64)

    def _monotone(
        self, at: Array, values: Array, asked: Array, inside: Flags, result: Array
    ) -> None:
        """Cubics by scipy, over each stretch of samples that are near enough to one another."""
        from scipy.interpolate import PchipInterpolator

        cuts = np.flatnonzero(np.diff(at) > self.reach * _ROUNDING) + 1
        for stretch in np.split(np.arange(len(at)), cuts):
            chosen = inside & (asked > at[stretch[0]]) & (asked < at[stretch[-1]])
            if chosen.any():
                result[chosen] = PchipInterpolator(at[stretch], values[stretch])(asked[chosen])

    def _forget(self, last: Array) -> None:
        """Drop rows that no time after ``last`` asks for: two samples before it are needed."""
        if not len(last):
            return
        first = int(np.searchsorted(self.time, last[0], side="right"))
        from_ = first
        oldest = last[0] - 2.0 * self.reach * _ROUNDING
        for c in range(self.values.shape[1]):
            known = np.flatnonzero(np.isfinite(self.values[:first, c]))
            if len(known) and self.held[c]:
                self.kept[:, c] = self.time[known[-1]], self.values[known[-1], c]
            elif len(known):
                from_ = min(from_, int(known[-2:][0]))
        from_ = max(from_, int(np.searchsorted(self.time, oldest, side="left")))
        self.time, self.values = self.time[from_:].copy(), self.values[from_:].copy()
