"""Estimates of rows of text as they come, bitwise those of a whole record.

Where no policy has anything to do, a row takes a short way: its numbers go from the text to the
observer and back without a detour by blocks. Else it is a block of one row.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping
from itertools import islice, tee

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import InputError, shown
from reobserve.estimation.dialect import Dialect, Head, read_head
from reobserve.estimation.estimate import Estimated, Estimation
from reobserve.estimation.gaps import MEASURED, STATUSES
from reobserve.estimation.refusals import RowError
from reobserve.estimation.text_rows import TextRows
from reobserve.estimation.writing import line as result
from reobserve.estimation.writing import text
from reobserve.observers.contract import Observer, StateKind
from reobserve.observers.record import Record

Array = NDArray[np.float64]

_REMEMBERED = 1000  # lines of rows
_PATIENCE = 20  # rows that all go the long way, on which the sampling period is checked


class RowByRow:
    """Takes a line and gives the lines of results that are settled with it, with so many digits."""

    def __init__(
        self, estimation: Estimation, header: Head | list[str], digits: int | None = None
    ) -> None:
        self.estimation, self.digits = estimation, digits
        layout, sampling = estimation.layout, estimation.specification.sampling
        head = header if isinstance(header, Head) else Head(header)
        dialect, report = Dialect.of(estimation.specification), estimation.report
        self.rows = TextRows(dialect, head, layout.titles, layout.clock, estimation.place, report)
        for why, count in head.left_out.items():
            report.count(report.left_out, why, count)
        self.stamp: int | None = None  # [ns], of the last row if it has a date
        self.short = (
            sampling.uneven == "refuse" and layout.clock is not None and dialect.plain
            and not layout.clock.elapsed
            and sampling.repeated in ("refuse", "first")
            and all(
                each.range is None and each.wrap is None and each.missing is None
                for each in layout.columns
            )
        )  # fmt: skip
        self.recent: tuple[float, list[float]] | None = None
        self.lines: deque[int] = deque(maxlen=_REMEMBERED)  # of the last rows
        self.y = np.empty((1, layout.measurements))
        self.u = np.empty((1, len(layout.names) - layout.timed - layout.measurements))

    def read(self, line: str) -> str:
        """The lines of results that a line of the record settles, perhaps none."""
        row = self.rows.row(line)
        if row is None:
            return ""
        self.lines.append(self.rows.line)
        try:
            cells = self.rows.cells(row)
            if cells is None:
                return ""
            if self.short:
                try:
                    numbers = [self._time([cells[place] for place in self.rows.clocks])]
                    numbers += [float(cells[place]) for place in self.rows.places[1:]]
                except (ValueError, OverflowError):
                    return self._long(cells)
                if "_" not in row and self._regular(numbers):
                    return self._short(numbers)
            return self._long(cells)
        except RowError as error:  # of this row, as the estimation takes one at a time
            waited = max(self.estimation.report.rows - error.row, 0)
            lines = [self.rows.line - waited, *islice(reversed(self.lines), waited, waited + 1)]
            raise error.at_line(lines[-1]) from None

    def _time(self, cells: list[str]) -> float:
        clock, report = self.rows.clock, self.estimation.report
        assert clock is not None
        if clock.dates is not None:
            self.stamp = clock.dates.nanoseconds(" ".join(map(str.strip, cells)), report)
            return report.since_origin(self.stamp)
        return clock.exact(cells[0], report) if report.shift else float(cells[0])

    def _regular(self, numbers: list[float]) -> bool:
        """True if a row stands a period after the one before, and all of it was measured."""
        made = self.estimation
        report, gaps = made.report, made.gaps
        if report.rows < _PATIENCE or not gaps.started or gaps.in_gap or report.last is None:
            return False
        if len(made.timestamps.early_time):
            return False
        if len(made.interpolation.asked) or not math.isfinite(sum(numbers)):
            return False
        return made.timestamps.follows(made.layout.conversions[0].of(numbers[0]))

    def _short(self, numbers: list[float]) -> str:
        made = self.estimation
        values = [
            way.of(number) for way, number in zip(made.layout.conversions, numbers, strict=True)
        ]
        report, gaps = made.report, made.gaps
        time = values.pop(0)
        report.rows += 1
        report.intervals += 1
        report.estimates += 1
        word = STATUSES[MEASURED]
        report.statuses[word] = report.statuses.get(word, 0) + 1
        report.last = gaps.last = time
        if self.stamp is not None:
            report.latest = self.stamp // 1000
        self.recent = (time, values)
        measured = self.y.shape[1]
        y, u = self.y, self.u
        y[0], u[0] = values[:measured], values[measured:]
        u = made.inputs.of(u)
        begun = made.state.count + 1 if made.state.sample is not None else 0
        try:
            made.state, estimates = unchecked_step(made.observer, made.state, y, u)
        except ArithmeticError:
            with made.dated(time, begun):
                raise
        if "outlier" in estimates:
            made.count_outliers(estimates["outlier"])
        columns = made.outputs.row(y, estimates)
        at, row = np.array([time]), np.array([columns])
        raised = [float(alarm.raised(at, row, report, estimates)[0]) for alarm in made.alarms]
        return result(report.stamp(time), columns, raised, MEASURED, self.digits)

    def cut_off(self, rest: str, how: str) -> None:
        """End a file that was replaced or truncated, with the ``rest`` of an unfinished line."""
        if rest and self.rows.dialect.file.tail != "drop":
            problem = (
                f"was {how} after line {self.rows.line}, and the next one has no end; with "
                "file.tail: drop it is left out"
            )
            raise InputError(self.estimation.place, problem)
        if rest:
            self.rows.row(rest)
        self.rows.finish()

    def go_on(self, lines: Iterator[str]) -> Iterator[str]:
        """The rows of a file that continues another one, with or without the same header."""
        rows, place = self.rows, self.estimation.place
        rows.line, (ahead, lines) = 0, tee(lines)
        try:
            head = read_head(ahead, rows.dialect, place)
        except InputError:
            if any(map(str.strip, lines)):
                raise
            return iter(())
        if head.titles == rows.head.titles:
            rows.line = head.lines
            return islice(lines, head.lines, None)
        if set(head.titles) & set(rows.titles):
            was, now = (shown(",".join(each.titles)) for each in (rows.head, head))
            raise InputError(place, f"goes on with the header {now}, must have that before, {was}")
        return lines

    def settle(self) -> None:
        """Hand what the short way has seen to the policies, before any of them is asked."""
        if self.recent is None:
            return
        time, values = self.recent
        self.recent = None
        interpolation, at = self.estimation.interpolation, np.array([time])
        interpolation.feed(at, np.array([values]), at)

    def _long(self, cells: list[str]) -> str:
        self.settle()
        numbers = self.rows.numbers(cells)
        if numbers is None:
            return ""
        return self._text(self.estimation.feed(np.array([numbers])))

    def finish(self) -> str:
        """The lines that waited for rows which do not come."""
        self.settle()
        self.rows.choice.check_some()
        return self._text(self.estimation.finish())

    def _text(self, block: Estimated) -> str:
        return text(block, self.estimation.report, self.digits)


def unchecked_step(
    observer: Observer[StateKind], state: StateKind, y: Array, u: Array
) -> tuple[StateKind, Mapping[str, Array]]:
    """The next state and the estimates of one row, which `Observer.step` would check first.

    Parameters
    ----------
    state
        One that this observer made.
    y, u
        As `Observer.run` would take them, of shape (1, p) and (1, m). So are the estimates, which
        keep their axis of samples.
    """
    record = Record(y, u)
    rows = observer._fill(state, record)
    if not observer._good(rows):
        time = np.array([observer._next_row(state) * observer.sampling_period])
        raise observer._divergence(state, rows, time, 0)
    return rows.state, rows.estimates
