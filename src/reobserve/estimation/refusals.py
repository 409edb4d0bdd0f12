"""Refusals of a record: raised one by one, or noted until its end, grouped by kind.

A stream raises the first refusal, since it cannot wait. Of a file they are noted: what is refused
is left out, and reading goes on, so that all refusals are found in one run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, ProblemsError

if TYPE_CHECKING:
    from reobserve.estimation.sampling_grid import UnevenError

Array = NDArray[np.float64]
Kind = tuple[str, ...]
Rows = Sequence[float] | NDArray[Any]
Error = InputError | Callable[[], InputError]

_MOST_LISTED = 20
_KINDS = 100  # beyond which those of one key are one
_FIRST = 3  # lines that are named
_KEPT = 1_000_000  # rows in memory, if no policy asks for what is missing between them
_BEFORE = "before"
# What the policies do that read a record on, by the key that states them.
POLICIES = {
    "sampling.repeated": {
        "first": "leaves out all but the first row of a timestamp",
        "last": "leaves out all but the last row of a timestamp",
        "merge": "makes one row of them, if no two differ in a number",
        "spread": "moves them evenly up to the next timestamp",
    },
    "sampling.missing": {
        "interpolate": "puts values between the samples beside it",
        "skip": "predicts, and corrects by the sensors that are there",
    },
    "sampling.at_gap": {
        "restart": "starts the observer again after the gap",
        "coast": "predicts over the gap, with inputs held",
    },
}


class RowError(InputError):
    """A problem in a row, which counts from 1.

    Parameters
    ----------
    parameter
        What is wrong, as in `InputError`.
    problem
        The rest of the sentence, with ``{at}`` for the row.
    """

    def __init__(self, parameter: str, problem: str, row: int) -> None:
        self.template, self.row = problem, row
        super().__init__(parameter, problem.replace("{at}", f"row {row}", 1))

    def at_line(self, line: int | None, word: str = "line") -> RowError:
        """The same by the line of the file, or by what the ``word`` says."""
        if line is not None:
            problem = self.template.replace("{at}", f"{word} {line}", 1)
            InputError.__init__(self, self.parameter, problem)
        return self


@dataclass
class Found:
    """Refusals of a kind: the first one, how many there are, and the first rows or lines."""

    error: InputError
    count: int
    rows: list[int]
    lines: list[int]
    last: float | None = None  # row


@dataclass(eq=False)
class Refusals:
    """Raises the first refusal or, if ``noting``, notes all, and counts those of a kind.

    ``survey`` has the error on jitter by what a whole record says of it, and the jitter by which
    reading goes on, if there is one.
    """

    noting: bool = False
    survey: Callable[[UnevenError], tuple[InputError, float | None]] = lambda error: (error, None)
    found: dict[Kind, Found] = field(default_factory=dict)
    # Rows that are used, with their times, and those that are refused.
    time: Array = field(default_factory=lambda: np.empty(0))
    rows: Array = field(default_factory=lambda: np.empty(0))
    left_out: Array = field(default_factory=lambda: np.empty(0))

    def refuse(self, kind: Kind, error: Error, rows: Rows = (), line: int | None = None) -> None:
        """Refuse rows, or a line, for a reason of some ``kind``, whose first part is a key.

        An error that is noted is made if it is the first one of its kind.
        """
        if not self.noting:
            raise error if isinstance(error, InputError) else error()
        if kind not in self.found and len(self.found) >= _KINDS:
            kind = kind[:1]
        found = self.found.get(kind)
        if found is None:
            made = error if isinstance(error, InputError) else error()
            found = self.found[kind] = Found(made, 0, [], [])
        elif list(rows[-1:]) == [found.last]:  # before which more than one row is missing
            return
        found.count += max(len(rows), 1)
        found.last = rows[-1] if len(rows) else None
        found.lines += [] if line is None else [line]
        found.rows += map(int, rows[:_FIRST])
        del found.lines[_FIRST:], found.rows[_FIRST:]

    def leave_out(self, rows: Rows) -> None:
        """Take rows that are refused, less a half for what lacks before one.

        What lacks for that is not refused again.
        """
        self.left_out = np.union1d(self.left_out, np.asarray(rows, dtype=np.float64))[-_KEPT:]

    def take(self, time: Array, rows: Array) -> None:
        """Take the times [s] and the numbers of rows that are used, in order."""
        if self.noting:
            self.time = np.concatenate([self.time, time])[-_KEPT:]
            self.rows = np.concatenate([self.rows, rows])[-_KEPT:]

    def forget(self, time: float) -> None:
        """Drop the rows up to a time, but the last one."""
        if not self.noting:
            return
        first = max(int(self.time.searchsorted(time)) - 1, 0)
        self.time, self.rows = self.time[first:].copy(), self.rows[first:].copy()
        if len(self.left_out) and len(self.rows):
            self.left_out = self.left_out[np.searchsorted(self.left_out, self.rows[0]) :]

    def at(self, time: float) -> tuple[list[float], str]:
        """The row of a time, or the one after, and which of the two."""
        k = int(self.time.searchsorted(time))
        return self.rows[k : k + 1].tolist(), "" if time in self.time[k : k + 1] else _BEFORE

    def excuses(self, time: float, even: bool) -> bool:
        """True if what is missing at a time is in a row that is refused.

        If rows are resampled, a time between two rows lacks what one of them lacks.
        """
        if not len(self.left_out):
            return False
        k = int(self.time.searchsorted(time))
        low, high = self.rows[k - 1] if k else 0.0, self.rows[k] if k < len(self.rows) else np.inf
        if time in self.time[k : k + 1]:
            low = high
        elif even:
            low, high = low + 0.25, high - 0.25
        k = int(self.left_out.searchsorted(low))
        return bool(k < len(self.left_out) and self.left_out[k] <= high)

    def between_rows(self, steps: Array, rows: Array) -> Array:
        """The intervals [s] up to rows, but those in which a row is refused."""
        if not self.found:
            return steps
        passed = np.diff(np.concatenate([self.rows[-1:], rows]))[-len(steps) :]
        chosen: Array = steps[passed == 1.0]
        return chosen

    def drop_lost(self) -> None:
        """Drop refusals of what is missing between rows, as another one says why."""
        self.found = {
            kind: one for kind, one in self.found.items()
            if _BEFORE not in kind and kind[0] != "sampling.at_gap"
        }  # fmt: skip

    def error(
        self, lines_at: Callable[[list[int]], dict[int, int]], predicts: bool, word: str
    ) -> InputError:
        """All that is refused, in the order of the lines.

        ``lines_at`` has the lines of rows, or what the ``word`` says. An observer that
        ``predicts`` can skip and coast.
        """
        lines = lines_at([row for one in self.found.values() for row in one.rows])
        listed = list[tuple[int, str, InputError]]()
        for kind, one in self.found.items():
            error, at = one.error, one.lines or [lines.get(row, row) for row in one.rows]
            if isinstance(error, RowError):
                error.at_line(lines.get(error.row), word)
            which = "before" if _BEFORE in kind else "in"
            place = f"{which} {word}"
            if one.count > 1:
                error.add_note(f"{one.count} times, first {place}s {', '.join(map(str, at))}")
            elif one.rows and not isinstance(error, RowError):
                error.add_note(f"{place} {at[0]}")
            listed.append((at[0] if at else 0, kind[0], error))
        errors, policies = list[InputError](), dict(POLICIES)
        for _, key, error in sorted(listed, key=lambda each: each[0]):
            errors.append(error)
            for value, does in policies.pop(key, {}).items():
                if predicts or value not in ("skip", "coast"):
                    error.add_note(f"{key}: {value} {does}")
        if (more := len(errors) - _MOST_LISTED) > 0:
            errors[_MOST_LISTED:] = [InputError(errors[0].parameter, f"is refused {more} more")]
        return ProblemsError(errors) if len(errors) > 1 else errors[0]
