"""The steps from row to row: what observers that integrate read at their ends and in between.

Where nothing else is given, measurements go in straight lines from sample to sample and known
inputs keep the value of their sample, as a controller holds them. With ``middle`` or ``before`` a
signal is as these say: limits from the left at samples, values in the middle, a straight line where
only the limits are given.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_numbers, as_row

if TYPE_CHECKING:
    from reobserve.observers.contract import IntegratingObserver, OnDivergence, StateKind
    from reobserve.observers.record import Record
    from reobserve.observers.run import Run

Array = NDArray[np.float64]
Pair = tuple[ArrayLike | None, ArrayLike | None]

# The classical Runge-Kutta method is stable for x' = -r x up to r h = 2.785.
STABLE_STEP = 2.78


class Samples(NamedTuple):
    """Values at both ends and in the middle of each of m steps, shape (2 m + 1, columns).

    ``left`` has the limits from the left; they count at the ends of steps.
    """

    right: Array
    left: Array

    @property
    def steps(self) -> int:
        """m."""
        return len(self.right) // 2


class Steps(NamedTuple):
    """Signals that an observer integrates over, y and u at the ends and the middle of steps."""

    y: Samples
    u: Samples


def steps_between(last: Array | None, record: Record) -> Steps:
    """The steps that lead from row to row, the first of them from ``last``, if there is one."""
    columns = record.y.shape[1]
    parts = (None, None) if last is None else (last[:columns], last[columns:])
    y = _samples(parts[0], record.y, record.before[0], record.middle[0], held=False)
    u = _samples(parts[1], record.u, record.before[1], record.middle[1], held=True)
    return Steps(y, u)


@np.errstate(over="ignore", invalid="ignore")
def _samples(
    last: Array | None, rows: Array, before: Array | None, middle: Array | None, *, held: bool
) -> Samples:
    begun = 1 if last is None else 0  # rows that no step leads to
    ends = rows[begun:]
    right = np.empty((2 * len(ends) + 1, rows.shape[1]))
    right[0] = rows[0] if last is None else last
    right[2::2] = ends
    starts = right[:-1:2]
    limits = ends if before is None else before[begun:]
    if held and before is None and middle is None:
        limits = right[1::2] = starts
    else:
        right[1::2] = 0.5 * starts + 0.5 * limits if middle is None else middle[begun:]
    if limits is ends:
        return Samples(right, right)
    left = right.copy()
    left[2::2] = limits
    return Samples(right, left)


def run_on_halves(
    observer: IntegratingObserver[StateKind],
    y: ArrayLike,
    u: ArrayLike | None = None,
    *,
    start: StateKind | None = None,
    y_before: ArrayLike | None = None,
    u_before: ArrayLike | None = None,
    on_divergence: OnDivergence = "raise",
) -> Run[StateKind]:
    """A run over a record that was sampled twice a period: every second sample is in the middle.

    A record that starts begins with a row; one that goes on from a start with its middle. Without
    ``y_before`` and ``u_before``, limits from the left, it does not jump.
    """
    begun = 1 if start is None or start.sample is None else 0  # rows that no step leads to
    y_rows, y_middle, y_left = _halves("y", y, y_before, begun)
    u_rows, u_middle, u_left = (None, None, None) if u is None else _halves("u", u, u_before, begun)
    return observer.run(
        y_rows, u_rows, start=start, before=(y_left, u_left), middle=(y_middle, u_middle),
        on_divergence=on_divergence,
    )  # fmt: skip


def _halves(
    name: str, values: ArrayLike, before: ArrayLike | None, begun: int
) -> tuple[Array, Array, Array | None]:
    """Every second sample, the middles before them, and the limits from the left."""
    samples = as_numbers(name, values)
    if samples.ndim == 0 or len(samples) % 2 != begun:
        kind = "an odd" if begun else "an even"
        raise InputError(name, f"has shape {samples.shape}, must have {kind} number of rows")
    middles = samples[::2] if not begun else np.concatenate([samples[:1], samples[1::2]])
    left = None if before is None else as_numbers(f"{name}_before", before)
    if left is not None and left.shape != samples.shape:
        raise InputError(f"{name}_before", f"has shape {left.shape}, must be {samples.shape}")
    return samples[1 - begun :: 2], middles, None if left is None else left[1 - begun :: 2]


def check_rate(name: str, rate: float, step: float) -> None:
    """Refuse a rate [1/s] of the estimator's own that the Runge-Kutta method cannot follow."""
    if rate * step > STABLE_STEP:
        raise InputError(
            name,
            f"makes a rate of {rate:g} 1/s, which with steps of {step:g} s is unstable; "
            f"rate times step must be {STABLE_STEP:g} or less",
        )


def as_pair(name: str, pair: Any) -> Pair:
    """A pair of y and u, each of which may be None, or `InputError` if it is none."""
    if not isinstance(pair, tuple | list) or len(pair) != 2:
        raise InputError(name, f"{shown(pair)} must be a pair of y and u")
    return pair[0], pair[1]


def as_row_pair(name: str, pair: Pair | None) -> Pair | None:
    """A pair of samples as records of one row."""
    if pair is None:
        return None
    y, u = as_pair(name, pair)
    return (
        None if y is None else as_row(f"{name} y", y),
        None if u is None else as_row(f"{name} u", u),
    )
