"""Inputs and outputs of observers: records, the rows of their loops, and checks of their states."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import all_finite, as_numbers, as_scalar

Array = NDArray[np.float64]
AnyState = TypeVar("AnyState")


class ObserverState(Protocol):
    """Fields that every state has beside what its method remembers.

    ``sample`` holds y and u of the last row that was taken, None before the first one; ``count``
    sampling periods have passed since that first one. ``time`` is that of the last row [s], None
    where it is counted from 0.
    """

    @property
    def sample(self) -> Array | None:
        """The last row, shape (p + m,)."""

    @property
    def count(self) -> int:
        """The number of sampling periods."""

    @property
    def time(self) -> float | None:
        """The time of the last row [s]."""


class Record(NamedTuple):
    """Record for an observer: k rows of y, (k, p), and of u, (k, m).

    ``before`` are limits from the left where a record jumps at samples, ``middle`` the values
    half a period before each row; each a pair of arrays like y and u, or of None. ``given`` is what
    the observer takes beside them, by name; ``time`` is that of the rows [s], if it is not counted,
    and ``periods`` lead to each row [s], shape (k + 1,), if they differ.
    """

    y: Array
    u: Array
    before: tuple[Array | None, Array | None] = (None, None)
    middle: tuple[Array | None, Array | None] = (None, None)
    given: Mapping[str, Any] = {}  # never written
    time: Array | None = None
    periods: Array | None = None


class Rows(NamedTuple):
    """Output of a compiled loop: arrays by name with one row a sample.

    ``finite`` rows are good, as the loop has it; ``state`` is the one after the last row, if all
    of them are. ``before`` are limits from the left, ``finding`` is why the loop stopped, if it
    knows, and ``source`` what the smoother reads. An observer that reads missing measurements may
    write nan for the estimates, and answers for its count of finite rows.
    """

    estimates: dict[str, Array]
    finite: int
    state: Any
    before: dict[str, Array] = {}  # noqa: RUF012  # never written
    finding: str = ""
    source: Any = None

    @property
    def good(self) -> int:
        """The number of rows that are finite in all arrays, up to the first that is not.

        A loop watches its state; what it reads from that may overflow a row earlier.
        """
        among = self.finite
        for array in (*self.estimates.values(), *self.before.values()):
            rows = array[:among]
            if not all_finite(rows):
                among = int(np.argmin(np.isfinite(rows).reshape(among, -1).all(axis=1)))
        return among


class Batch(NamedTuple):
    """Output of the compiled loop for many records: arrays (records, k, ...), and lists of `Rows`.

    ``goods`` are numbers of good rows; ``states`` are those after the last rows.
    """

    estimates: dict[str, Array]
    before: dict[str, Array]
    goods: list[int]
    states: list[Any]
    findings: list[str]
    sources: list[Any]


def stacked(every: Sequence[Mapping[str, Array]]) -> dict[str, Array]:
    """Estimates of many records with an axis for them, nan where a loop wrote fewer rows."""
    estimates = {}
    for name in every[0]:
        longest = max((each[name] for each in every), key=len)
        estimates[name] = whole = np.full((len(every), *longest.shape), np.nan)
        for values, record in zip(whole, every, strict=True):
            values[: len(record[name])] = record[name]
    return estimates


def depth_of(value: Any) -> int:
    """The number of axes of nested lists, as their first entries show."""
    depth = 0
    while isinstance(value, list | tuple) and value:
        value, depth = value[0], depth + 1
    return depth + np.ndim(value) if isinstance(value, np.ndarray) else depth


def check_state(
    state: Any, kind: type[AnyState], problem: str, name: str = "start", **shapes: tuple[int, ...]
) -> AnyState:
    """A state whose arrays have these shapes, as compiled loops take them.

    Raises
    ------
    InputError
        If it is no such state, with ``problem`` if only its shapes are others, or not finite.
    """
    if not isinstance(state, kind):
        raise InputError(name, f"{shown(state)} must be a state from init or from an earlier run")
    changed: dict[str, Array] = {}
    for part, shape in shapes.items():
        value = getattr(state, part)
        if part == "sample" and value is None:
            continue
        array = as_numbers(f"{name}.{part}", value, writable=False)
        if array.shape != shape:
            raise InputError(name, problem)
        if not all_finite(array):
            raise InputError(f"{name}.{part}", f"{shown(array)} has an entry that is not finite")
        if array is not value:
            changed[part] = array
    count = getattr(state, "count", 0)
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 0:
        raise InputError(f"{name}.count", f"{shown(count)} must be a whole number, 0 or more")
    if (time := getattr(state, "time", None)) is not None:
        as_scalar(f"{name}.time", time)
    return replace(state, **changed) if changed else state  # type: ignore[type-var]


def warn_caller(warning: Warning) -> None:
    """Warn at the line that called the library."""
    frame, level = sys._getframe(1), 2
    while frame.f_back and frame.f_back.f_globals.get("__name__", "").startswith("reobserve."):
        frame, level = frame.f_back, level + 1
    warnings.warn(warning, stacklevel=level + 1)
