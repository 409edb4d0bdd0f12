"""The contract of observers: what all of them check, and what they do when they diverge.

An observer is a frozen dataclass, its state a value. `step` takes the samples of one step, `run` a
whole record through one compiled loop over the same arithmetic, so that both give the same bits.
Either raises `DivergenceError` where an estimate leaves the range of floating-point numbers, unless
`run` is asked to return what it had.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, Generic, Literal, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import DivergenceError, InputError, shown
from reobserve.numerics.arguments import as_word
from reobserve.numerics.matrices import as_numbers, as_samples

Array = NDArray[np.float64]
OnDivergence = Literal["raise", "return"]


class CountedState(Protocol):
    """A state that knows how many steps were taken."""

    @property
    def count(self) -> int:
        """The number of steps."""


StateKind = TypeVar("StateKind")
Counted = TypeVar("Counted", bound=CountedState)
Result = TypeVar("Result")


class Samples(NamedTuple):
    """Samples at both ends and in the middle of each of m steps, shape (2 m + 1, ...).

    Where a record jumps, ``left`` has the limits from the left; they count at the ends of steps.
    """

    right: Array
    left: Array

    @classmethod
    def read(
        cls, name: str, right: ArrayLike, left: ArrayLike | None, columns: int | None,
        *, rows: int | None = None, like: str = "", left_name: str | None = None,
    ) -> Samples:  # fmt: skip
        """What a user gave; without limits from the left the record does not jump.

        Raises
        ------
        InputError
            If one is no record of ``columns`` finite numbers a row, two rows a step and one.
        """
        first = as_samples(name, right, columns, rows=rows, like=like, halves=True)
        if left is None or left is right:
            return cls(first, first)
        named = left_name or f"{name}_before"
        return cls(first, as_samples(named, left, columns, rows=len(first), like=like or name))

    @property
    def steps(self) -> int:
        """m."""
        return len(self.right) // 2

    def part(self, first: int, last: int) -> Samples:
        """The steps from ``first`` up to ``last``, which is not among them."""
        rows = slice(2 * first, 2 * last + 1)
        return Samples(self.right[rows], self.left[rows])

    def halved(self) -> Samples:
        """Twice as many steps, with parabolas through the three samples of each one."""
        right, left = self.right, self.left
        start, middle, end = right[:-1:2], right[1::2], left[2::2]
        finer = np.empty((2 * len(right) - 1, *right.shape[1:]))
        finer[::2] = right
        finer[1::4] = 0.375 * start + 0.75 * middle - 0.125 * end
        finer[3::4] = 0.375 * end + 0.75 * middle - 0.125 * start
        before = finer.copy()
        before[::4] = left[::2]
        return Samples(finer, before)


Record = tuple[Samples, ...]


class Rows(NamedTuple):
    """What a compiled loop wrote: a row at the start of a record and one a step, in each array.

    ``finite`` rows are good, as the loop has it; ``state`` is the one after the last step, if all
    of them are.
    """

    arrays: tuple[Array, ...]
    finite: int
    state: Any


class FixedStepObserver(ABC, Generic[Counted, Result]):
    """An observer that integrates with a fixed step and reads two samples a step.

    What derives from it says how its loop is called, and how a result is made of rows.
    """

    step_size: float

    @abstractmethod
    def _fill(self, state: Counted, record: Record) -> Rows:
        """Run the compiled loop over a record."""

    @abstractmethod
    def _result(
        self, arrays: tuple[Array, ...], state: Counted, diverged_at: float | None
    ) -> Result:
        """The result of a run."""

    def _halved(self, state: Counted) -> tuple[FixedStepObserver[Counted, Result], Counted] | None:
        """The same observer and state with half the step; None if there is no such thing."""
        finer: Any = replace(self, step_size=0.5 * self.step_size)  # type: ignore[type-var]
        return finer, replace(state, count=2 * state.count)  # type: ignore[type-var]

    def _observe(
        self, state: Counted, record: Record, on_divergence: OnDivergence = "raise"
    ) -> Result:
        """The result of a run over a record that was checked.

        Raises
        ------
        DivergenceError
            If a row is not finite and ``on_divergence`` is not ``return``; it says whether that
            is the observer's doing or the step's.
        """
        loud = raises(on_divergence)
        rows = self._fill(state, record)
        finite = finite_rows(rows.arrays, rows.finite)
        if finite == record[0].steps + 1:
            return self._result(rows.arrays, rows.state, None)
        diverged_at = max(finite - 1, 0) * self.step_size
        if not loud:
            return self._result(tuple(array[:finite] for array in rows.arrays), state, diverged_at)
        from reobserve.observers.halving import finding

        raise DivergenceError(
            type(self).__name__,
            state.count * self.step_size + diverged_at,
            finding(self, state, record, finite),
        )


def raises(on_divergence: Any) -> bool:
    """Whether a run that diverges is to raise; `InputError` if the word is neither."""
    return as_word("on_divergence", on_divergence, ("raise", "return")) == "raise"


def finite_rows(arrays: tuple[Array, ...], among: int) -> int:
    """How many of the first ``among`` rows are finite in all arrays, up to the first that is not.

    A loop watches its state; what it reads from that may overflow a row earlier.
    """
    for array in arrays:
        good = np.isfinite(array[:among])
        if not good.all():
            among = int(np.argmin(good.reshape(len(good), -1).all(axis=1)))
    return among


def check_state(
    state: Any, kind: type[StateKind], problem: str, name: str = "state", **shapes: tuple[int, ...]
) -> StateKind:
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
        given = getattr(state, part)
        array = as_numbers(f"{name}.{part}", given)
        if array.shape != shape:
            raise InputError(name, problem)
        if not np.isfinite(array).all():
            raise InputError(f"{name}.{part}", f"{shown(array)} has an entry that is not finite")
        if array is not given:
            changed[part] = array
    count = getattr(state, "count", 0)
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 0:
        raise InputError(f"{name}.count", f"{shown(count)} must be a whole number, 0 or more")
    return replace(state, **changed) if changed else state  # type: ignore[type-var]
