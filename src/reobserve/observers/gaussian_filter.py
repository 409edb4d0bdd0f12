"""The base class of filters that estimate a state by its mean and covariance.

The first row of a record corrects the estimate that `init` was given; before each later row the
filter predicts with the input of the row before, and corrects with that of the row itself.
`predict` and `correct` are the two halves, which a bank of filters calls one by one.

A nan in a row of measurements was not measured: its innovation is nan, and the run counts such
rows. The other numbers of the row correct as if they alone were measured.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind, as_word
from reobserve.core.covariances import as_covariance
from reobserve.core.errors import DivergenceError, InputError, shown
from reobserve.core.loop_function import RaisedAfterLoop
from reobserve.core.matrices import as_floats, as_positive, as_row, as_samples, as_vector
from reobserve.core.value import read_only
from reobserve.observers.contract import Observer
from reobserve.observers.gaussian_state import (
    Correction,
    FilterPosteriors,
    FilterRows,
    FilterSteps,
    Gaussian,
    KalmanState,
    PredictedRows,
    Rules,
    Source,
    as_held,
    check_held,
    check_noise,
    check_noise_memory,
    check_posterior,
    check_sample,
    forgetting,
    inputs_of_rows,
    periods_of,
    reached,
    refuse_given,
    sample_before,
    warn_of_start,
    warn_of_starts,
    without_correlation,
)
from reobserve.observers.many_records import in_threads, part
from reobserve.observers.one_row import OneRow, is_plain
from reobserve.observers.record import Batch, Record, Rows, check_state
from reobserve.observers.run import AxisNames, Estimate, names_by_model
from reobserve.systems.periods import wrapped

Array = NDArray[np.float64]

EVEN = 1e-9  # of the sampling period: by how much even times may differ
DT_AND_TIME = 1e-6  # of the sampling period: how far times may be from those that dt led to
ROWS_FOR_THREADS = 10_000  # of all records: fewer are done before threads have started
KEPT = PredictedRows._fields


def uneven_times(
    model: Any, time: ArrayLike | None, state: Any, record: Record
) -> tuple[Array, Record] | None:
    """The times of the rows, and the record with what leads to each of them, or None if even.

    ``dt`` in the record leads from each row to the next one; ``time`` are those of the rows.

    Raises
    ------
    InputError
        If both are given, the times do not increase or dt is not positive; or if the time of the
        row before is not known.
    """
    rows, period, given = len(record.y), model.sampling_period, record.given.get("dt")
    held = state.held.get("dt") if isinstance(state.held, Mapping) else None
    if given is not None and time is not None:
        raise InputError("dt", "is given beside time, must be the only one of them")
    reached = state.sample is not None and (state.count or not np.isnan(state.sample).any())
    if time is not None or (given is None and held is None):
        able = getattr(model, "density", None) is not None or "Q" in record.given
        if time is None or not able or not model.continuous:
            return None
        times = as_samples("time", time, None, rows=rows, like="y").copy()
        last = state.count * period if state.time is None and reached else state.time
        first = period if last is None else times[0] - last
        if held is not None and abs(first - held[0]) > DT_AND_TIME * period:
            problem = (
                f"begins {first:.9g} s after the row before, from where dt was {held[0]:.9g} s"
            )
            raise InputError("time", problem)
        if state.time is None and reached and abs(first - period) > EVEN * period:
            raise InputError(
                "time", f"begins at {times[0]:.9g} s, but the state was reached without times, "
                f"which counts as {last:.9g} s; give time to the run before, too",
            )  # fmt: skip
        periods = np.concatenate([[first], np.diff(times)])
        if periods.min() <= 0:
            row = int(np.argmax(periods <= 0))
            problem = f"must increase, does not at row {row}, of {times[row]:.9g} s"
            raise InputError("time", problem)
        periods[np.abs(periods - period) <= EVEN * period] = period
        if (periods == period).all():
            return times, record._replace(time=times)
        return times, record._replace(time=times, periods=periods)
    lengths = np.full(rows, period) if given is None else as_floats("dt", given)
    if lengths.shape not in ((), (rows,)) or not 0 < lengths.min() <= lengths.max() < 1e150:
        raise InputError("dt", f"{shown(given)} must be a positive time, or {rows} of them")
    first = np.atleast_1d(period if held is None else held)
    periods = np.concatenate([first, np.broadcast_to(lengths, rows)])
    after = np.cumsum(periods[:-1])
    last = state.count * period if state.time is None else state.time
    times = after - after[0] if state.sample is None else last + after
    return times, record._replace(time=times, periods=periods)


def uneven_hint(model: Any) -> str:
    """The way in which a filter on this model takes other times, as the end of a sentence."""
    if getattr(model, "density", None) is not None:
        return ""
    if model.continuous:
        return "; for other times give from_ode the density of the noise, or Q by row"
    return "; for other times make the model by from_ode, with the density of the noise"


def can_run_together(records: Sequence[Record], states: Sequence[KalmanState]) -> bool:
    """True if the same matrices lead to the rows of all records."""
    first, first_record = states[0], records[0]
    alike = all(
        (state.sample is None) == (first.sample is None) and state.held is first.held is None
        for state in states
    )
    return alike and first_record.periods is None and "S" not in first_record.given


def posteriors_of(states: Sequence[KalmanState], n: int, m: int) -> FilterPosteriors:
    """Copies of what the states hold, which the loops move."""
    many = len(states)
    copies = FilterPosteriors(
        np.empty((many, n)), np.empty((many, n, n)), np.empty((many, m)), np.empty((many, m)),
        np.empty(many),
    )  # fmt: skip
    for r, state in enumerate(states):
        posterior = state.posterior
        copies.means[r], copies.covariances[r] = posterior.mean, posterior.covariance
        copies.errors[r] = posterior.error
        copies.counts[r] = state.count + (state.sample is not None)
        if state.noise is not None:
            copies.noises[r] = state.noise
    return copies


@dataclass(frozen=True, eq=False, repr=False)
class GaussianFilter(Observer[KalmanState]):
    """Base class of filters of mean and covariance, which a subclass tells by which steps it works.

    Its estimates are ``state``, shape (k, n), and ``covariance``, (k, n, n), with ``variance``,
    (k, n), on its diagonal, after each measurement; ``innovation``, (k, m), and
    ``innovation_covariance``, (k, m, m), nan where a measurement is missing; and
    ``log_likelihood``, (k,), of the measurement, zero where all of it is missing.

    With a ``gate`` there is also ``outlier``, (k, m): innovations beyond it in their standard
    deviations, zero elsewhere; `Run.outliers` counts their rows. With ``noise_memory`` there is
    ``noise_variance``, (k, m), the diagonal of R as estimated.

    Parameters
    ----------
    model
        The model that it trusts, whose sampling period is the filter's.
    gate, outliers, noise_memory
        As those of `KalmanFilter`.

    Raises
    ------
    InputError
        If it is a model of another kind, a number is not above zero; or R cannot be estimated, as
        it is less than a tenth of the innovation's variance: it would take a hundred memories.
    """

    model: Any
    sampling_period: float = field(init=False)
    gate: float | None = field(default=None, kw_only=True)
    outliers: Literal["skip", "inflate"] = field(default="skip", kw_only=True)
    noise_memory: float | None = field(default=None, kw_only=True)

    steps: ClassVar[FilterSteps]
    has_kalman_gain: ClassVar[bool] = False  # without, R cannot be estimated, nothing smoothed
    keeps: ClassVar[tuple[str, ...]] = KEPT
    reads_missing: ClassVar[bool] = True
    units: ClassVar[Mapping[str, str]] = dict.fromkeys((*FilterRows._fields, "variance"), "")

    def __post_init__(self) -> None:
        period: float = as_kind("model", self.model, self.steps.model).sampling_period
        self._set("sampling_period", period)
        self._set_rules()

    def _set_rules(self) -> None:
        """Check gate and memory, which the model must allow."""
        for name in ("gate", "noise_memory"):
            value = getattr(self, name)
            self._set(name, None if value is None else as_positive(name, value))
        self._set("outliers", as_word("outliers", self.outliers, ("skip", "inflate")))
        if self.noise_memory is not None:
            check_noise_memory(self)

    @property
    def method(self) -> Any:
        """The difference from other filters by the same steps, as the compiled steps read it."""
        raise NotImplementedError

    @cached_property
    def _rules(self) -> Rules:
        """The filter's settings beside its model, as compiled loops read them."""
        return Rules(
            *periods_of(self), np.inf if self.gate is None else self.gate,
            self.outliers == "inflate", forgetting(self.noise_memory, self.sampling_period),
        )  # fmt: skip

    @cached_property
    def _periods(self) -> Mapping[str, Array]:
        periods = self.model.state_periods
        return {} if periods is None else dict.fromkeys(("state", "predicted_state"), periods)

    def _work(self) -> Any:
        """New scratch for the compiled loops."""
        return self.steps.work(self.whole.states, self.whole.outputs, self._rules)

    @property
    def _start_noise(self) -> Array | None:
        """The variances of R that an estimate starts from, shape (m,), or None."""
        return None if self.noise_memory is None else np.diag(self.whole.R).copy()

    @cached_property
    def whole(self) -> Any:
        """The model of all that is estimated, which is the filter's own but for unknown inputs."""
        return self.model

    @cached_property
    def measurements(self) -> int:
        """The number of measurements in a row of y."""
        return int(self.model.outputs)

    @cached_property
    def inputs(self) -> int:
        """The number of known inputs in a row of u."""
        return int(self.model.inputs)

    @cached_property
    def component_names(self) -> Mapping[str, AxisNames]:
        """Names of components of estimates, for each axis of one, where the model has them."""
        names, m = names_by_model(self.model), self.model.output_names
        n = self._all_names
        if n or m:
            names |= {"predicted_state": (n,), "predicted_covariance": (n, n), "gain": (n, m)}
        return names

    @property
    def _all_names(self) -> tuple[str, ...] | None:
        return self.model.state_names  # type: ignore[no-any-return]

    def init(
        self, mean: ArrayLike, covariance: ArrayLike, *, u: ArrayLike | None = None
    ) -> KalmanState:
        """The state before the first row of a record.

        Parameters
        ----------
        mean
            Of the state, shape (n,).
        covariance
            Of the state: a number, n numbers or (n, n); positive semidefinite.
        u
            Left out, mean and covariance are meant at the first row, whose measurement corrects
            them. Given, they are meant a sampling period before it, and u, shape (p,), is the
            input that is held up to it: the filter then predicts first.

        Raises
        ------
        InputError
            If one of them is not that.
        """
        (n, p, m), periods, learned = self._sizes, self._rules.state_periods, self.noise_memory
        x, P = as_vector("mean", mean, n), as_covariance("covariance", covariance, n)
        x = wrapped(x, periods) if periods.any() else x.copy()
        return KalmanState._made(
            posterior=Gaussian._made(mean=read_only(x), covariance=read_only(P), error=np.zeros(m)),
            sample=None if u is None else sample_before(u, m, p), count=0, held=None, time=None,
            noise=None if learned is None else self._start_noise, checked=self._sizes,
        )  # fmt: skip

    def predict(self, posterior: Gaussian, u: ArrayLike = ()) -> Gaussian:
        """Time update with the input that is held over the step, shape (p,).

        Gadsden et al. 2011, (11) and (12).

        Raises
        ------
        InputError
            If the input u or the posterior has another size, or a Python function returns other
            shapes.
        DivergenceError
            If the result is not finite; its time counts from there.
        """
        n, m = self.whole.states, self.whole.outputs
        posterior = check_posterior("posterior", posterior, n, m)
        control = as_vector("u", u, self.whole.inputs)
        model, inputs, _ = self.steps.in_record(
            self, {}, np.empty((1, m)), np.array([[control, control]]), {}, None
        )
        after = posteriors_of([KalmanState(posterior, noise=self._start_noise)], n, m)
        nothing = np.full((1, 1, m), np.nan)
        _, _, ends = self._filtered(model, inputs, nothing, False, after)
        if not ends[0, 0]:
            raise DivergenceError(type(self).__name__, 0.0, self.steps.causes.get(ends[0, 1], ""))
        return Gaussian(after.means[0], after.covariances[0], posterior.error)

    def correct(self, posterior: Gaussian, y: ArrayLike, u: ArrayLike = ()) -> Correction:
        """Measurement update of a predicted posterior (Gadsden et al. 2011, (13) to (19)).

        Raises
        ------
        InputError
            If y (nan: missing), its input u or the posterior has another size, or a Python
            function returns other shapes.
        DivergenceError
            If the covariance of the innovation is not positive definite, the posterior leaves the
            range of floating-point numbers, or rounding makes a variance negative; its time counts
            from there.
        """
        n, m = self.whole.states, self.whole.outputs
        taken = as_samples("y", as_row("y", y), m, missing=True)[0]
        control = as_vector("u", u, self.whole.inputs)
        posterior = check_posterior("posterior", posterior, n, m)
        if np.isnan(taken).all():
            return Correction(posterior, np.full(m, np.nan), np.full((m, m), np.nan), 0.0)
        model, inputs, _ = self.steps.in_record(
            self, {}, taken[None], np.array([[control, control]]), {}, None
        )
        after = posteriors_of([KalmanState(posterior, noise=self._start_noise)], n, m)
        rows, _, ends = self._filtered(model, inputs, taken[None, None], True, after)
        if not ends[0, 0]:
            raise DivergenceError(type(self).__name__, 0.0, self.steps.causes.get(ends[0, 1], ""))
        return Correction(
            Gaussian(*(part[0] for part in after[:3])), rows.innovation[0, 0],
            rows.innovation_covariance[0, 0], float(rows.log_likelihood[0, 0]),
        )  # fmt: skip

    def _given(self, given: Mapping[str, Any], rows: int) -> Mapping[str, Any]:
        """The values given by name for k rows, for the model of all that is estimated."""
        return given

    def _uneven(
        self, time: ArrayLike | None, state: KalmanState, record: Record
    ) -> tuple[Array, Record] | None:
        if self.noise_memory is not None:  # which counts sampling periods
            return None
        return uneven_times(self.whole, time, state, record)

    @property
    def _uneven_hint(self) -> str:
        return uneven_hint(self.whole)

    def _filtered(
        self, model: Any, inputs: Array, y: Array, fresh: bool, after: FilterPosteriors,
        keep: Sequence[str] = (),
    ) -> tuple[FilterRows, PredictedRows | None, NDArray[np.int64]]:  # fmt: skip
        """Run the loop over records, (records, k, m), which moves the posteriors ``after``.

        The last array, (records, 2), says how many rows are good, and why the loop stopped.
        """
        records, k, m = y.shape
        n = after.means.shape[1]
        gated, learned = self.gate is not None, self.noise_memory is not None
        rows = FilterRows(
            np.empty((records, k, n)), np.empty((records, k, n, n)), np.empty((records, k, m)),
            np.empty((records, k, m, m)), np.empty((records, k)),
            np.empty((records, k if gated else 1, m)), np.empty((records, k if learned else 1, m)),
        )  # fmt: skip
        kept = None
        if keep and any(name in KEPT for name in keep):
            kept = PredictedRows(
                np.empty((records, k, n)), np.empty((records, k, n, n)),
                np.empty((records, k, n, m)),
            )  # fmt: skip
        ends, method, spare = np.zeros((records, 2), np.int64), self.method, self._spare

        def block(cut: slice) -> None:
            parts = [None if all_ is None else part(all_, cut) for all_ in (after, rows, kept)]
            work = self._work()
            with RaisedAfterLoop():
                self.steps.run(model, method, y[cut], inputs[cut], fresh, *parts, work, ends[cut])

        python = bool(getattr(self.whole, "uncompiled", ()))
        if records > 1 and records * k >= ROWS_FOR_THREADS and not python:
            in_threads(block, records)
        else:
            try:
                work = spare.pop()
            except IndexError:
                work = self._work()
            with RaisedAfterLoop():
                self.steps.run(model, method, y, inputs, fresh, after, rows, kept, work, ends)
            spare.append(work)
        return rows, kept, ends

    def _quick_step(
        self, state: KalmanState, y: Any, u: Any
    ) -> tuple[KalmanState, Estimate] | None:
        (n, p, m), learned = self._sizes, self.noise_memory is not None
        if (
            type(state) is not KalmanState or vars(state).get("checked") != (n, p, m)
            or state.held is not None or state.sample is None or state.count <= n
            or (state.noise is not None) is not learned or not is_plain(y, u, m, p)
            or type(self)._fill is not GaussianFilter._fill
        ):  # fmt: skip
            return None
        try:
            row = self._spare_rows.pop()
        except IndexError:
            row = self._new_row()
        after, rows, ends = row.posterior, row.rows, row.arguments[-1]
        after.means[0], after.covariances[0] = state.posterior.mean, state.posterior.covariance
        after.errors[0] = state.posterior.error
        if learned:
            after.noises[0], after.counts[0] = state.noise, state.count + 1
        row.y[0], row.inputs[0, :p] = y, state.sample[m:]
        row.inputs[1, :p] = () if u is None else u
        row.run()
        if not ends[0, 0]:
            return None  # the way of all records says why
        known, values, units = self.units, {}, {}
        for name, array in self._by_name(rows, None, ()).items():
            values[name], units[name] = array[0, 0].copy(), known.get(name, "")
        count, T = state.count + 1, self.sampling_period
        time = None if state.time is None else state.time + T
        reached = KalmanState._made(
            posterior=Gaussian._made(
                mean=after.means[0].copy(), covariance=after.covariances[0].copy(),
                error=after.errors[0].copy(),
            ),
            sample=np.concatenate([y, u]) if p else y.copy(), count=count, held=None, time=time,
            noise=after.noises[0].copy() if learned else None, checked=(n, p, m),
        )  # fmt: skip
        self._spare_rows.append(row)
        return reached, Estimate(count * T if time is None else time, values, units)

    @cached_property
    def _spare_rows(self) -> list[OneRow]:
        """Rows that no thread uses at the moment."""
        return []

    def _new_row(self) -> OneRow:
        n, p, m = self._sizes
        y, ends = np.zeros((1, 1, m)), np.zeros((1, 2), np.int64)
        model, inputs, _ = self.steps.in_record(self, {}, y[0], np.zeros((1, 2, p)), {}, None)
        after = FilterPosteriors(
            np.zeros((1, n)), np.zeros((1, n, n)), np.zeros((1, m)), np.ones((1, m)), np.zeros(1)
        )
        shapes = (1, 1, n), (1, 1, n, n), (1, 1, m), (1, 1, m, m), (1, 1), (1, 1, m), (1, 1, m)
        rows = FilterRows(*map(np.empty, shapes))
        arguments = model, self.method, y, inputs, False, after, rows, None, self._work(), ends
        return OneRow(self.steps.run, arguments, after, rows, y[0], inputs[0])

    @cached_property
    def _spare(self) -> list[Any]:
        """Scratch that no thread uses at the moment."""
        return []

    def _by_name(
        self, rows: FilterRows, kept: PredictedRows | None, keep: Sequence[str]
    ) -> dict[str, Array]:
        """The estimates by their names."""
        state, covariance, innovation, innovation_covariance, log_likelihood = rows[:5]
        estimates = {
            "state": state,
            "variance": covariance.diagonal(axis1=-2, axis2=-1),
            "covariance": covariance,
            "innovation": innovation,
            "innovation_covariance": innovation_covariance,
            "log_likelihood": log_likelihood,
        }
        if self.gate is not None:
            estimates["outlier"] = rows.outlier
        if self.noise_memory is not None:
            estimates["noise_variance"] = rows.noise_variance
        return estimates | {name: getattr(kept, name) for name in keep} if keep else estimates

    def _names_to_keep(self, given: Mapping[str, Any]) -> Sequence[str]:
        """Names of what else the run shall hold."""
        names = given.get("keep", ())
        names = tuple(names) if isinstance(names, list | tuple) else (names,)
        for name in names:
            if not isinstance(name, str) or name not in self.keeps:
                raise InputError("keep", f"{shown(name)} must be one of {', '.join(self.keeps)}")
        return names

    def _fill(self, state: KalmanState, record: Record) -> Rows:
        batch, estimates = self._run_together([record], [state]), {}
        for name, array in batch.estimates.items():
            estimates[name] = array[0]
        return Rows(
            estimates, batch.goods[0], batch.states[0], {}, batch.findings[0], batch.sources[0]
        )

    def _run_records(self, records: Sequence[Record], states: Sequence[KalmanState]) -> Batch:
        if can_run_together(records, states):
            return self._run_together(records, states)
        return super()._run_records(records, states)  # what leads to each row differs

    def _run_together(self, records: Sequence[Record], states: Sequence[KalmanState]) -> Batch:
        """Run the compiled loop on records to whose rows the same matrices lead."""
        first, first_record, given = states[0], records[0], records[0].given
        (n, _, m), keep = self._sizes, self._names_to_keep(given) if given else ()
        if given:
            given = self._given(given, len(first_record.y))
            refuse_given(self, given)
        y, inputs = [], []
        for state, record in zip(states, records, strict=True):
            y.append(record.y)
            inputs.append(inputs_of_rows(state.sample, record))
        alone = len(records) == 1
        model, known, last = self.steps.in_record(
            self, given, first_record.y, inputs[0][None] if alone else np.array(inputs),
            first.held or {}, first_record.periods,
        )  # fmt: skip
        after = posteriors_of(states, n, m)
        starts = after.covariances.diagonal(0, 1, 2).copy()
        rows, kept, ends = self._filtered(
            model, known, y[0][None] if alone else np.array(y), first.sample is None, after, keep
        )
        if first.count <= n and n * m > 1:  # of one number Joseph's form loses nothing
            P, S = rows.covariance[:, : n + 1], rows.innovation_covariance[:, : n + 1]
            P = P.diagonal(0, 2, 3)
            if alone:
                good = ends[0, 0]
                warn_of_start(starts[0], P[0, :good], S[0, :good])
            else:
                warn_of_starts(starts, P, ends[:, 0], S)
        held = as_held(last, model.correlation)
        reached_states, findings, sources, causes = [], [], [], self.steps.causes
        if "functions" in model._fields:  # which the filter has, and which may have no pickle
            model = model._replace(functions=None)
        for r, cause in enumerate(ends[:, 1].tolist()):
            read = without_correlation(model, known[r])
            sources.append(Source(self, *read) if self.has_kalman_gain else None)
            reached_states.append(reached(after, r, states[r], records[r], held, self._sizes))
            findings.append(causes[cause] if cause else "")
        return Batch(
            self._by_name(rows, kept, keep), {}, ends[:, 0].tolist(), reached_states, findings,
            sources,
        )  # fmt: skip

    @cached_property
    def _sizes(self) -> tuple[int, int, int]:
        return self.whole.states, self.whole.inputs, self.whole.outputs

    def _checked(self, state: Any) -> KalmanState:
        checked = type(state) is KalmanState and vars(state).get("checked") == self._sizes
        if checked and (state.noise is None) is (self.noise_memory is None):
            if state.held is not None:  # which may be of a model with other parameters
                check_held(state.held, self)
            return state  # type: ignore[no-any-return]
        given = check_state(state, KalmanState, "")
        n, p, m = self._sizes
        posterior = check_posterior("start.posterior", given.posterior, n, m)
        sample = check_sample(given.sample, m, p)
        noise = check_noise(given.noise, self.noise_memory is not None, m)
        held = check_held(given.held, self)
        same = posterior is given.posterior and sample is given.sample and noise is given.noise
        if same and held is None:
            return given
        return KalmanState(posterior, sample, given.count, held, given.time, noise)
