"""A record through an observer, a block of rows or a single one at a time."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve.core.errors import DivergenceError, InputError, located
from reobserve.estimation.alarms import alarms, warn_of_start_up
from reobserve.estimation.constants import inputs
from reobserve.estimation.data_report import DataReport
from reobserve.estimation.diagnostics import FirstRows
from reobserve.estimation.gaps import Gaps, Stretch, joined
from reobserve.estimation.interpolation import Interpolation, Settled
from reobserve.estimation.layout import Layout, lay_out
from reobserve.estimation.observer_design import Design
from reobserve.estimation.output_columns import Outputs, outputs
from reobserve.estimation.refusals import Refusals
from reobserve.estimation.specification import Specification
from reobserve.estimation.start_up import start_up
from reobserve.estimation.timestamps import Timestamps
from reobserve.observers.gaussian_filter import KEPT
from reobserve.observers.gaussian_state import VagueStartWarning
from reobserve.observers.run import Run

Array = NDArray[np.float64]


_FEW_OUTLIERS, _SHARE_OF_OUTLIERS = 20, 0.1


class Estimated(NamedTuple):
    """Rows of results: times [s], the columns' numbers, the alarms, and a status each."""

    time: Array
    numbers: Array
    alarms: Array
    status: NDArray[np.int8]


class Estimation:
    """All that stands between the rows of a record and the rows of its estimates.

    However rows come in blocks, the estimates are bitwise identical.

    Parameters
    ----------
    specification
        What the user says.
    header
        The titles of the record's columns.
    place
        What the record is called in messages.
    refusals
        What takes refusals of rows; without it, the first one is raised.

    Raises
    ------
    InputError
        If the observer cannot be made, or it, the columns and the policies do not fit.
    """

    def __init__(
        self,
        specification: Specification,
        header: list[str],
        place: str,
        refusals: Refusals | None = None,
    ) -> None:
        self.specification, self.place = specification, place
        sampling, period = specification.sampling, specification.sampling.period
        with located("observer"):
            self.design: Design = specification.observer.design(period)
        self.observer = self.design.observer
        self.layout: Layout = lay_out(specification.columns, self.design, header, place, period)
        self.inputs = inputs(specification.columns, self.design)
        self.can_skip = self.observer.reads_missing
        for key, word, others in (
            ("missing", "skip", "refuse or interpolate"),
            ("at_gap", "coast", "refuse or restart"),
        ):
            if getattr(sampling, key) == word and not self.can_skip:
                problem = f"{word} is for observers that predict without measurements, as Kalman "
                raise InputError(f"sampling.{key}", f"{problem}filters do; here it may be {others}")
        self.whole = _whole(self.observer) if specification.smooth else None
        self.report = DataReport(period=period)
        if refusals is not None:
            self.report.refusals = refusals
        clock, timed = self.layout.clock, self.layout.timed
        self.timestamps = Timestamps(
            sampling, self.report, place,
            None if clock is None else clock.dates,
            specification.columns.time.wrap is not None,
            tuple(zip(self.layout.names, self.layout.units, strict=True))[timed:],
        )  # fmt: skip
        width, names = self.layout.measurements, self.layout.names[timed:]
        holds = tuple(column.missing == "hold" for column in self.layout.columns[timed:])
        every = self.design.holds_inputs  # input, and not only those whose cells are empty
        held = tuple(c >= width and (every or hold) for c, hold in enumerate(holds))
        self.interpolation = _interpolation(specification, held)
        self.gaps = Gaps(sampling, self.report, place, names, width, self.can_skip, holds)
        self.report.warnings += self.design.unseen
        self.state: Any = None
        self.waiting: list[Stretch] = []  # for a smoother, up to the next start
        self.first_rows: FirstRows | None = None
        self.curves: Any = None  # of a plot, which takes each stretch with its results
        self.sample = self._sample(width, len(names) - width)
        self.outputs: Outputs = outputs(
            self.design, self.layout, self.sample, specification.estimates
        )
        self.start_up: list[float] | None = None
        self.alarms = alarms(self)

    def _sample(self, measurements: int, inputs: int) -> Any:
        """The estimates of a row of zeros, for their shapes, which compiles what is to run.

        Where measurements may be missing they are, since a model need not have a value there.
        """
        state = self.design.begin(np.zeros(measurements))
        y = np.full((1, measurements), np.nan if self.can_skip else 0.0)
        run = self.run(y, self.inputs.of(np.zeros((1, inputs))), state)
        self.template = run.end
        return run.estimates

    def run(self, y: Array, u: Array, state: Any) -> Run[Any]:
        """The run of the observer over rows, smoothed if that is asked for."""
        if self.whole is not None:
            return self.whole(y, u, state)
        result: Run[Any] = self.observer.run(y, u, start=state)
        return result

    def start_up_of(self, column: int) -> float:
        """The time [s] that a column needs to forget how the observer started."""
        if self.start_up is None:
            inputs = len(self.layout.names) - self.layout.timed - self.layout.measurements

            def run(y: Array) -> Array:
                state, u = self.design.begin(y[0]), self.inputs.of(np.zeros((len(y), inputs)))
                return self.outputs.numbers(y, self.observer.run(y, u, start=state).estimates)

            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                spreads = [self.outputs.deviation_of(c) for c in range(len(self.outputs.columns))]
                rows = start_up(run, self.layout.measurements, spreads)
            self.start_up = (self.specification.sampling.period * rows).tolist()
        return self.start_up[column]

    def feed(self, raw: Array) -> Estimated:
        """The estimates that are settled with these rows, cells in the order of the layout.

        Raises
        ------
        InputError
            If a policy refuses what is there.
        DivergenceError
            If the observer diverges, with the time of the record.
        """
        time, values = self.layout.values(raw, self.report)
        if not self.layout.timed:
            first = self.report.rows
            rows = np.arange(first, first + len(values), dtype=np.float64)
            time = self.specification.sampling.period * rows
        if self.specification.sampling.repeated != "merge":
            self.layout.fill(values, self.report)
        return self._estimate(self._settled(self.timestamps.read(time, values)), False)

    def _settled(self, rows: tuple[Array, Array, Array]) -> Settled:
        if self.specification.sampling.repeated == "merge":
            self.layout.fill(rows[1], self.report)
        return self.interpolation.feed(*rows)

    def finish(self) -> Estimated:
        """The estimates that waited for rows which do not come."""
        rows = self.timestamps.finish()
        self.timestamps.check_period()
        parts = [self._estimate(self._settled(rows), False)] if len(rows[0]) else []
        result = concatenated([*parts, self._estimate(self.interpolation.finish(), True)])
        warn_of_start_up(self.report)
        return result

    def _none(self) -> Estimated:
        width, signals = len(self.outputs.columns), len(self.alarms)
        return Estimated(
            np.empty(0), np.empty((0, width)), np.empty((0, signals)), np.empty(0, dtype=np.int8)
        )

    def _estimate(self, rows: Settled, final: bool) -> Estimated:
        taken = self.gaps.feed(rows, final)
        if self.report.refusals.found:
            return self._none()
        stretches = [one._replace(u=self.inputs.of(one.u)) for one in taken]
        if self.whole is not None:
            stretches = self._from_start_to_start(stretches, final)
        parts = [self._run(stretch) for stretch in stretches]
        return concatenated(parts) if parts else self._none()

    def _from_start_to_start(self, stretches: list[Stretch], final: bool) -> list[Stretch]:
        """Stretches from one start of the observer to the next, as far as they are complete."""
        self.waiting += stretches
        starts = [k for k, stretch in enumerate(self.waiting) if stretch.fresh]
        ends = [*starts[1:], *([len(self.waiting)] if final and starts else [])]
        runs = [joined(self.waiting[start:end]) for start, end in zip(starts, ends, strict=False)]
        self.waiting = self.waiting[ends[-1] :] if ends else self.waiting
        return runs

    def _run(self, stretch: Stretch) -> Estimated:
        if self.first_rows is not None:
            self.first_rows.take(stretch)
        if stretch.fresh:
            self.state = self.design.begin(stretch.y[0])
            for entry in self.report.alarms.values():
                entry.start(float(stretch.time[0]))
        begun = self.state.sample is not None
        rows = self.state.count + 1 if begun else 0
        with warnings.catch_warnings(record=True) as doubts:
            warnings.simplefilter("ignore")  # of blocks; `diagnostics` checks the whole
            warnings.simplefilter("always", VagueStartWarning)
            with self.dated(float(stretch.time[0]), rows):
                run = self.run(stretch.y, stretch.u, self.state)
        self.state = run.end
        self._warn_of_start(stretch.time, [doubt.message for doubt in doubts])
        if "outlier" in run:
            self.count_outliers(run["outlier"])
        results = self.reported(stretch.time, stretch.y, run.estimates, stretch.status)
        if self.curves is not None:
            self.curves.add(results, stretch, run.estimates)
        return results

    def _warn_of_start(self, time: Array, doubts: list[Any]) -> None:
        """Report the first of the observer's warnings of a start that is too vague, at its time."""
        if doubts and not any("rounding leaves few digits" in one for one in self.report.warnings):
            at = self.report.said(float(time[doubts[0].row]))
            self.report.warn(doubts[0].sentence.format(at=at))

    def count_outliers(self, outliers: Array) -> None:
        """Count what is beyond the gate, and warn where that is more than a rare outlier."""
        names = self.layout.names[self.layout.timed :]
        for name, count in zip(names, np.count_nonzero(outliers, axis=0).tolist(), strict=False):
            self.report.count(self.report.outliers, name, count)
            total = self.report.outliers.get(name, 0)
            if total > max(_FEW_OUTLIERS, _SHARE_OF_OUTLIERS * self.report.estimates):
                self.report.warn(
                    f"{name}: the gate leaves out more than one measurement in ten; a fault, a "
                    "wrong model or a start that is far off looks like that"
                )

    @contextmanager
    def dated(self, time: float, rows: int) -> Iterator[None]:
        """Give a divergence the time of the record: at ``time`` the observer has seen ``rows``."""
        try:
            yield
        except DivergenceError as error:
            past = error.time - rows * self.specification.sampling.period
            raise DivergenceError(
                error.what, time + past + (self.report.shift or 0), error.finding
            ) from None

    def reported(
        self, time: Array, y: Array, estimates: Any, status: NDArray[np.int8]
    ) -> Estimated:
        """Rows of results from estimates."""
        numbers = self.outputs.numbers(y, estimates)
        raised = np.empty((len(time), len(self.alarms)))
        for k, alarm in enumerate(self.alarms):
            raised[:, k] = alarm.raised(time, numbers, self.report, estimates)
        self.report.estimates += len(time)
        return Estimated(time, numbers, raised, status)

    @property
    def titles(self) -> list[str]:
        """Titles of the results: time, estimates, residuals, alarms, status."""
        columns = [column.title for column in self.outputs.columns]
        time = "time" if self.timestamps.dates else "time [s]"
        return [time, *columns, *(f"alarm {a.rule.name}" for a in self.alarms), "status"]


def concatenated(parts: Sequence[Estimated]) -> Estimated:
    """Results one below the other."""
    if len(parts) == 1:
        return parts[0]
    return Estimated(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _whole(observer: Any) -> Callable[[Array, Array, Any], Run[Any]]:
    """Runs of an observer whose estimates are smoothed."""
    from reobserve.observers.smoother import rts_smoother

    if not getattr(observer, "has_kalman_gain", False):
        raise InputError(
            "smooth", "true is for the kinds kalman (with a varying gain), augmented-kalman, "
            "extended-kalman and unscented-kalman; here it must be false",
        )  # fmt: skip

    def run(y: Array, u: Array, state: Any) -> Run[Any]:
        crossed = [name for name in observer.keeps if name not in KEPT]
        result = observer.run(y, u, start=state, keep=crossed)
        smooth = rts_smoother(result)
        return replace(result, estimates={**result.estimates, **smooth.estimates})

    return run


def _interpolation(specification: Specification, held: tuple[bool, ...]) -> Interpolation:
    sampling = specification.sampling
    even = sampling.uneven == "refuse"
    if sampling.missing == "interpolate":
        reach = sampling.longest
    else:
        reach = 0.0 if even else 2.0 * sampling.period
    hold = reach
    if sampling.missing == "skip":
        hold = sampling.longest
    if sampling.at_gap == "coast":
        hold = np.inf
    method, period = ("linear", 0.0) if even else (sampling.uneven, sampling.period)
    return Interpolation(method, reach, hold, held, period)
