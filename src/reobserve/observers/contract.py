"""The contract of observers: one way to call all of them.

    state = observer.init(...)                      what it starts from
    state, estimate = observer.step(state, y, u)    one sample
    run = observer.run(y, u, start=state)           a whole record

Measurements ``y`` and known inputs ``u`` of one sample stand in the same row, ``sampling_period``
seconds after the row before; u is the input from that sample on. The estimate of a row is made
from the rows up to it. An observer is a frozen dataclass of its model and then its gains. `run` is
one compiled loop over the arithmetic of `step`, so that both give bitwise identical results.

What a method needs between samples it has by a rule of its own, which each observer states; who
knows more of it gives it as ``middle`` and ``before``. Filters take more by name, such as matrices
of their model for each row: `Observer.takes`. Many records of equal length are (records, k, m).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Generic, Literal, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_word
from reobserve.core.errors import DivergenceError, InputError
from reobserve.core.loop_function import RaisedAfterLoop
from reobserve.core.matrices import all_finite, as_positive, as_row, as_sample_rows, as_samples
from reobserve.core.value import Value, converter
from reobserve.observers import dataframes
from reobserve.observers.dataframes import run_other
from reobserve.observers.fixed_step import Pair, Steps, as_pair, as_row_pair, steps_between
from reobserve.observers.record import (
    Batch,
    ObserverState,
    Record,
    Rows,
    check_state,
    stacked,
)
from reobserve.observers.run import AxisNames, Estimate, Run, names_by_model

__all__ = ["Observer", "ObserverState", "OnDivergence", "Record", "Rows", "check_state"]

Array = NDArray[np.float64]
OnDivergence = Literal["raise", "return"]
Sample = ArrayLike | Mapping[str, float]  # a row of y or u, or its numbers by name

_UNEVEN = 0.01  # of the sampling period: how much longer or shorter the time between rows may be


StateKind = TypeVar("StateKind", bound=ObserverState)


@dataclass(frozen=True, eq=False, repr=False)
class Observer(Value, ABC, Generic[StateKind]):
    """The base class of observers: `step`, `run`, and the checks of their arguments.

    A class that derives from it says what it reads, what it estimates and how its loop is called:
    `_integrate` where it takes steps between the rows, `_fill` where it goes from row to row.

    Parameters
    ----------
    sampling_period
        [s], by its name; an observer on a linear model takes that of the model.
    """

    sampling_period: float = field(kw_only=True, metadata=converter(as_positive))

    reads_missing: ClassVar[bool] = False  # whether a nan may stand for what was not measured
    takes: ClassVar[tuple[str, ...]] = ()  # what `run` and `step` take beside y and u, by name

    @property
    @abstractmethod
    def measurements(self) -> int:
        """The number of measurements in a row of y."""

    @property
    @abstractmethod
    def inputs(self) -> int:
        """The number of known inputs in a row of u."""

    @property
    @abstractmethod
    def units(self) -> Mapping[str, str]:
        """The unit of each estimate by its name, empty where it is that of the user's model."""

    @property
    def component_names(self) -> Mapping[str, AxisNames]:
        """Names of components of estimates, for each axis of one, where the model has them."""
        return names_by_model(getattr(self, "model", None))

    @property
    def _periods(self) -> Mapping[str, Array]:
        """The periods of components of estimates that are angles, by name."""
        return {}

    @abstractmethod
    def _checked(self, state: Any) -> StateKind:
        """The state as the loop takes it, or `InputError` if it is of no such observer."""

    @abstractmethod
    def _fill(self, state: StateKind, record: Record) -> Rows:
        """Run the compiled loop over a record."""

    def _start(self, first: Array) -> StateKind:
        """The state where none is given, for the first row of y."""
        raise InputError(
            "start", f"must be given: {type(self).__name__}.init says what it starts from"
        )

    def step(
        self, start: StateKind, y: Sample, u: Sample | None = None, *,
        time: float | None = None,
    ) -> tuple[StateKind, Estimate]:  # fmt: skip
        """Take one sample: the start of the next one, and the estimates at it.

        Stepping through a record gives bitwise what `run` gives.

        Parameters
        ----------
        start
            From `init`, or from the sample before.
        y, u, time
            As those of `run`, without the axis of samples. Of y and u also numbers by name, of
            which measurements may be left out.

        Raises
        ------
        InputError
            As `run`.
        DivergenceError
            As `run`.
        """
        return self._step_given(start, y, u, time, {})

    def run(
        self, y: ArrayLike, u: ArrayLike | None = None, *, start: StateKind | None = None,
        time: ArrayLike | None = None, on_divergence: OnDivergence = "raise",
    ) -> Run[StateKind]:  # fmt: skip
        """Estimates at all samples of a record, by one compiled loop.

        Parameters
        ----------
        y
            Measurements, shape (k, m), or (k,) where m is 1; nan where one is missing, if the
            observer reads that. Many records at once are (records, k, m). The columns of a frame
            are those of the model by name, and its index of times is that of the run's frame.
        u
            Known inputs from each sample on, shape (k, p), or (k,); left out where there are none.
            Many records have one of these, or (records, k, p).
        start
            From `init`, or from an earlier run or step to go on with the sample after its last.
        time
            Of the samples [s], shape (k,), or dates, a sampling period apart; left out, it counts
            from 0 or goes on from the start.
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `Run.diverged_at`.

        Raises
        ------
        InputError
            If a shape is wrong, a number is not finite, the times are not a sampling period apart,
            or the start is of another observer.
        DivergenceError
            If an estimate leaves the range of floating-point numbers.
        """
        return self._run_given(y, u, start, time, on_divergence, {})

    def _step_given(
        self, state: StateKind, y: Any, u: Any, time: float | None,
        given: Mapping[str, Any], before: Pair | None = None, middle: Pair | None = None,
    ) -> tuple[StateKind, Estimate]:  # fmt: skip
        """`step`, with what a class takes beside y, u and time in ``given``, by name."""
        if time is None and before is None and middle is None:
            for value in given.values():
                if value is not None:
                    break
            else:
                quick = self._quick_step(state, y, u)
                if quick is not None:
                    return quick
        plain = type(y) in dataframes.PLAIN and type(u) in dataframes.PLAIN
        if not plain or before is not None or middle is not None:
            y, u, before, middle = dataframes.read_rows(self, y, u, before, middle)
        record = self._read(
            as_row("y", y), None if u is None else as_row("u", u),
            as_row_pair("before", before), as_row_pair("middle", middle), given,
        )  # fmt: skip
        start = self._checked(state)
        times, record = self._timed(None if time is None else [time], start, record)
        rows = self._fill(start, record)
        if not self._good(rows):
            raise self._divergence(start, rows, times, 0)
        known, values, units = self.units, {}, {}
        for name, array in rows.estimates.items():
            values[name], units[name] = array[0], known.get(name, "")
        return rows.state, Estimate(float(times[0]), values, units)

    def _quick_step(self, state: StateKind, y: Any, u: Any) -> tuple[StateKind, Estimate] | None:
        """`step` on plain numbers where an observer has a faster way, bitwise the same."""
        return None

    def _run_given(
        self, y: ArrayLike, u: ArrayLike | None, state: StateKind | None, time: ArrayLike | None,
        on_divergence: str, given: Mapping[str, Any], before: Pair | None = None,
        middle: Pair | None = None,
    ) -> Run[StateKind]:  # fmt: skip
        """`run`, with what a class takes beside y, u and time in ``given``, by name."""
        loud = type(on_divergence) is str and on_divergence == "raise"
        if not loud:
            as_word("on_divergence", on_divergence, ("raise", "return"))
        plain = type(y) is np.ndarray and y.ndim < 3 and (u is None or type(u) is np.ndarray)
        if plain and time is None and before is None and middle is None:
            return self._run_record(y, u, state, None, None, None, loud, given)
        run: Run[StateKind] = run_other(self, y, u, state, time, before, middle, loud, given)
        return run

    def _run_record(
        self, y: ArrayLike, u: ArrayLike | None, state: StateKind | None, time: ArrayLike | None,
        before: Pair | None, middle: Pair | None, loud: bool, given: Mapping[str, Any],
    ) -> Run[StateKind]:  # fmt: skip
        """`run` of one record of arrays."""
        record = self._read(y, u, before, middle, given)
        start = self._start(record.y[0]) if state is None else self._checked(state)
        times, record = self._timed(time, start, record)
        rows = self._fill(start, record)
        good = self._good(rows)
        estimates, left, missing = rows.estimates, rows.before, 0
        if self.reads_missing and not all_finite(record.y):
            missing = int(np.isnan(record.y[:good]).any(axis=1).sum())
        after, diverged_at, known, units = rows.state, None, self.units, {}
        if good < len(times):
            if loud:
                raise self._divergence(start, rows, times, good)
            estimates = {name: array[:good] for name, array in estimates.items()}
            left = {name: array[:good] for name, array in left.items()}
            after, diverged_at = start, self._last_finite(start, times, good)
        for name in estimates:
            units[name] = known.get(name, "")
        return Run(
            times[:good], estimates, units, after, diverged_at, left, missing,
            self.component_names, None, self._periods, rows.source,
        )  # fmt: skip

    def _run_records(self, records: Sequence[Record], states: Sequence[StateKind]) -> Batch:
        """Run the compiled loop on many records."""
        pairs = zip(states, records, strict=True)
        every = [self._fill(state, record) for state, record in pairs]
        return Batch(
            stacked([rows.estimates for rows in every]), stacked([rows.before for rows in every]),
            [self._good(rows) for rows in every], [rows.state for rows in every],
            [rows.finding for rows in every], [rows.source for rows in every],
        )  # fmt: skip

    def _good(self, rows: Rows) -> int:
        """The number of good rows, which with missing measurements the loop alone can tell."""
        return rows.finite if self.reads_missing else rows.good

    def _divergence(self, state: StateKind, rows: Rows, times: Array, good: int) -> DivergenceError:
        """The error to raise where the rows of a record beyond the first ``good`` ones diverged."""
        last = self._last_finite(state, times, good)
        return DivergenceError(type(self).__name__, last, rows.finding)

    def _last_finite(self, state: StateKind, times: Array, good: int) -> float:
        """The time [s] up to which estimates are finite, perhaps that of the state's sample."""
        if good:
            return float(times[good - 1])
        last = self._last_time(state)
        if last is not None:
            return last
        return float(times[0]) - (0.0 if state.sample is None else self.sampling_period)

    def _read(
        self,
        y: ArrayLike,
        u: ArrayLike | None,
        before: Pair | None,
        middle: Pair | None,
        given: Mapping[str, Any],
    ) -> Record:
        measured = as_sample_rows("y", y, self.measurements, missing=self.reads_missing)
        rows = len(measured)
        known = self._read_inputs("u", u, rows)
        if given:
            given = self._known(given)
        if before is None and middle is None:
            return Record(measured, known, given=given)
        between = (("before", before), ("middle", middle))
        early, half = (self._read_pair(name, pair, rows) for name, pair in between)
        return Record(measured, known, early, half, given)

    def _known(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """The values that are not None, or `InputError` if the class does not take one."""
        known = {}
        for name, value in given.items():
            if value is not None:
                if name not in self.takes:
                    others = f"beside y and u it takes {', '.join(self.takes)}"
                    problem = f"is not taken by {type(self).__name__}, {others}"
                    raise InputError(name, problem)
                known[name] = value
        return known

    def _read_inputs(self, name: str, u: ArrayLike | None, rows: int) -> Array:
        if u is None and not self.inputs:
            return np.empty((rows, 0))
        if u is None:
            raise InputError(name, f"is left out, must have shape {(rows, self.inputs)}")
        return as_sample_rows(name, u, self.inputs, rows=rows)

    def _read_pair(
        self, name: str, pair: Pair | None, rows: int
    ) -> tuple[Array | None, Array | None]:
        if pair is None:
            return (None, None)
        y, u = as_pair(name, pair)
        return (
            None
            if y is None
            else as_sample_rows(
                f"{name} y", y, self.measurements, rows=rows, missing=self.reads_missing
            ),
            None if u is None else self._read_inputs(f"{name} u", u, rows),
        )

    @staticmethod
    def _next_row(state: ObserverState) -> int:
        """The number of sampling periods from the first row of all to the next one."""
        return 0 if state.sample is None else state.count + 1

    def _uneven(
        self, time: ArrayLike | None, state: StateKind, record: Record
    ) -> tuple[Array, Record] | None:
        """The times of rows that are not a sampling period apart, None where they must be."""
        return None

    @property
    def _uneven_hint(self) -> str:
        """The way in which the observer takes uneven times, as the end of a sentence."""
        return ""

    def _last_time(self, state: ObserverState) -> float | None:
        """The time [s] of the last sample, given or counted, or None if there was none yet."""
        if state.time is not None or state.sample is None:
            return state.time
        begun = state.count or not np.isnan(state.sample).any()
        return state.count * self.sampling_period if begun else None

    def _timed(
        self, time: ArrayLike | None, state: StateKind, record: Record
    ) -> tuple[Array, Record]:
        """The times of the rows, and the record with them if they are not counted."""
        rows, held = len(record.y), getattr(state, "held", None)
        if time is not None or record.given or held is not None:
            timed = self._uneven(time, state, record)
            if timed is not None:
                return timed
        if time is None:
            if state.time is None:
                first = 0 if state.sample is None else state.count + 1
                return (first + np.arange(rows, dtype=np.float64)) * self.sampling_period, record
            times = state.time + self.sampling_period * np.arange(1.0, rows + 1.0)
            return times, record._replace(time=times)
        times, last = as_samples("time", time, None, rows=rows, like="y"), self._last_time(state)
        between = np.diff(times if last is None else np.concatenate([[last], times]))
        with np.errstate(over="ignore"):
            off = np.abs(between - self.sampling_period)
        if off.size and off.max() > _UNEVEN * self.sampling_period:
            row = int(np.argmax(off > _UNEVEN * self.sampling_period)) + (last is None)
            before = last if row == 0 else times[row - 1]
            counted = getattr(self, "noise_memory", None) is not None
            hint = ", which noise_memory counts" if counted else self._uneven_hint
            raise InputError(
                "time",
                f"goes from {before:.9g} to {times[row]:.9g} s at row {row}, must go "
                f"on by the sampling period of {self.sampling_period:g} s{hint}",
            )
        return times.copy(), record._replace(time=times)


class IntegratingObserver(Observer[StateKind]):
    """The base class of observers that take steps between the rows: `_integrate` calls their loop.

    What a method needs between samples it has by a rule of its own; who knows more of it gives it
    as ``middle`` and ``before``.
    """

    exact: ClassVar[bool] = False  # whether its steps are, so that shorter ones change nothing

    def step(
        self, start: StateKind, y: Sample, u: Sample | None = None, *,
        time: float | None = None, before: Pair | None = None, middle: Pair | None = None,
    ) -> tuple[StateKind, Estimate]:  # fmt: skip
        """Take one sample: the start of the next one, and the estimates at it.

        Stepping through a record gives bitwise what `run` gives.

        Parameters
        ----------
        start
            From `init`, or from the sample before.
        y, u, time, before, middle
            As those of `run`, without the axis of samples. Of y and u also numbers by name, of
            which measurements may be left out.

        Raises
        ------
        InputError
            As `run`.
        DivergenceError
            As `run`.
        """
        return self._step_given(start, y, u, time, {}, before, middle)

    def run(
        self, y: ArrayLike, u: ArrayLike | None = None, *, start: StateKind | None = None,
        time: ArrayLike | None = None, before: Pair | None = None, middle: Pair | None = None,
        on_divergence: OnDivergence = "raise",
    ) -> Run[StateKind]:  # fmt: skip
        """Estimates at all samples of a record, by one compiled loop.

        Parameters
        ----------
        y, u
            Measurements, shape (k, m), and known inputs, (k, p), held or in straight lines from
            sample to sample, as the class says; (k,) where m or p is 1, u left out where p is 0.
            Frames and many records as `Observer.run` has them.
        start
            From `init`, or from an earlier run or step to go on with the sample after its last.
        time
            Of the samples [s], shape (k,), or dates, a sampling period apart; left out, it counts
            from 0 or goes on from the start.
        before
            y and u where a record jumps at samples: their limits from the left, in their shapes.
        middle
            y and u half a period before each sample, in their shapes. The first ones of a record
            have no use.
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `Run.diverged_at`.

        Raises
        ------
        InputError
            If a shape is wrong, a number is not finite, the times are not a sampling period apart,
            or the start is of another observer.
        DivergenceError
            If an estimate leaves the range of floating-point numbers; it says whether a shorter
            step may help.
        """
        return self._run_given(y, u, start, time, on_divergence, {}, before, middle)

    @abstractmethod
    def _integrate(self, state: StateKind, steps: Steps) -> Rows:
        """Run the compiled loop over steps, which the state after it has counted.

        It writes a row at the start of the first step and one at the end of each.
        """

    def _completed(self, state: StateKind, record: Record) -> tuple[StateKind, Record]:
        """State and record with what the observer finds by itself, such as derivatives."""
        return state, record

    def _fill(self, state: StateKind, record: Record) -> Rows:
        """Run the compiled loop over a record."""
        state, record = self._completed(state, record)
        with RaisedAfterLoop():
            rows = self._integrate(state, steps_between(state.sample, record))
        begun = 0 if state.sample is None else 1  # the row of the sample before, which is known
        last = np.concatenate([record.y[-1], record.u[-1]])
        return Rows(
            {name: values[begun:] for name, values in rows.estimates.items()},
            rows.finite - begun,
            rows.state._with(
                sample=last, time=None if record.time is None else float(record.time[-1])
            ),
            {name: values[begun:] for name, values in rows.before.items()},
        )

    def _divergence(self, state: StateKind, rows: Rows, times: Array, good: int) -> DivergenceError:
        if (good > 0 or state.sample is not None) and not self.exact:
            finding = f"a step of {self.sampling_period:g} s may be too long for it"
            rows = rows._replace(finding=finding)
        return super()._divergence(state, rows, times, good)
