"""The base class of filters that estimate a state by its mean and covariance.

The first row of a record corrects the estimate that `init` was given; before each later row the
filter predicts with the input of the row before, and corrects with that of the row itself.
`predict` and `correct` are the two halves, which a bank of filters calls one by one.

A nan in a row of measurements stands for a number that was not measured: its innovation is nan, and
the run counts such rows. The other numbers of the row correct as if they alone were measured; over
a row of nothing but nan the filter predicts.
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
from reobserve.core.matrices import as_positive, as_row, as_samples, as_vector
from reobserve.core.value import for_loop
from reobserve.observers.contract import Observer
from reobserve.observers.gaussian_state import (
    Correction,
    FilterSteps,
    Gaussian,
    InRecord,
    KalmanState,
    Matrices,
    ModeFilter,
    check_held,
    check_noise,
    check_posterior,
    check_sample,
    check_time,
    inputs_of_rows,
    reached,
    sample_before,
)
from reobserve.observers.estimated_noise import check_noise_memory
from reobserve.observers.linear_loop import FilterPosteriors, FilterRows, PredictedRows
from reobserve.observers.linear_steps import Rules
from reobserve.observers.many import in_threads, part
from reobserve.observers.record import Many, Record, Rows, check_state
from reobserve.observers.run import AxisNames, names_by_model
from reobserve.observers.uneven_times import uneven_hint, uneven_times
from reobserve.observers.vague_start import warn_of_start, warn_of_starts

__all__ = ["KEPT", "Correction", "Gaussian", "GaussianFilter", "KalmanState", "ModeFilter"]

Array = NDArray[np.float64]

ROWS_FOR_THREADS = 10_000  # of all records: fewer are done before threads have started


KEPT = PredictedRows._fields


@dataclass(frozen=True, eq=False, repr=False)
class GaussianFilter(Observer[KalmanState]):
    """Base class of filters of mean and covariance, which a subclass tells by which steps it works.

    Its estimates are ``state``, shape (k, n), and ``covariance``, (k, n, n), with ``variance``,
    (k, n), on its diagonal, after each measurement; ``innovation``, (k, m), and
    ``innovation_covariance``, (k, m, m), nan where a measurement is missing; and
    ``log_likelihood``, (k,), of the measurement, zero where all of it is missing.

    `run` and `step` take by name, in place of the model's and for this record:

    A, B, C, D, Q, R
        Matrices of a linear model, Q and R of any: as in the model, or one for each row, (k, ., .).
        Those of row k in A, B and Q lead from row k to row k + 1; C, D and R are the row's own.
    S
        E[w v'], shape (n, m) or (k, n, m), of a Kalman filter on a linear model: the covariance of
        the process noise from a row on with the measurement noise of that row.
    parameters, dt
        Of a nonlinear model: values of parameters by name, numbers or (k,); and the time [s] from
        each row to the next one, (k,), which a model from `from_ode` takes.
    keep
        A list of what else the run shall hold: ``predicted_state``, (k, n), and
        ``predicted_covariance``, (k, n, n), before each measurement, and ``gain``, (k, n, m).

    With a ``gate`` there is also ``outlier``, (k, m): innovations beyond it in their standard
    deviations, zero elsewhere; `Run.outliers` counts their rows. With ``noise_memory`` there is
    ``noise_variance``, (k, m), the diagonal of R as estimated.

    Parameters
    ----------
    model
        The model that it trusts, whose sampling period is the filter's.
    gate
        How many standard deviations an innovation may have, each output for itself: what is beyond
        is an outlier. Left out, none is. A fault that looks like outliers is rejected with them, so
        look at ``outlier``.
    outliers
        ``skip``: they count as missing; or ``inflate``: their variance of noise is raised so far
        that they are at the gate.
    noise_memory
        [s]. The diagonal of R is estimated while running, with this memory and from that of the
        model on: R <- R + g diag(R S^-1 (e e' - S) S^-1 R), with the weight g = max(T / memory,
        1 / (k + 20)) of row k, expectation maximisation that forgets (Shumway & Stoffer 1982).
        Correlations stay those of the model.

    Raises
    ------
    InputError
        If it is a model of another kind, a number is not above zero; or R cannot be estimated, as
        it is less than a tenth of the innovation's variance: ten times less information a row is a
        hundred times the memory.
    """

    model: Any
    sampling_period: float = field(init=False)
    gate: float | None = field(default=None, kw_only=True)
    outliers: Literal["skip", "inflate"] = field(default="skip", kw_only=True)
    noise_memory: float | None = field(default=None, kw_only=True)

    steps: ClassVar[FilterSteps]
    has_kalman_gain: ClassVar[bool] = False  # without, R cannot be estimated
    keeps: ClassVar[tuple[str, ...]] = KEPT
    reads_between: ClassVar[bool] = False
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
        whole, memory = self.whole, self.noise_memory
        x, y = whole.state_periods, whole.output_periods
        return Rules(
            np.zeros(whole.states) if x is None else for_loop(x),
            np.zeros(whole.outputs) if y is None else for_loop(y),
            np.inf if self.gate is None else self.gate, self.outliers == "inflate",
            0.0 if memory is None else min(1.0, self.sampling_period / memory),
        )  # fmt: skip

    @property
    def _periods(self) -> Mapping[str, Array]:
        found = self.model.state_periods
        return {} if found is None else dict.fromkeys(("state", "predicted_state"), found)

    def _work(self) -> Any:
        """New scratch for the compiled loops."""
        return self.steps.work(self.whole.states, self.whole.outputs, self._rules)

    @property
    def _start_noise(self) -> Array | None:
        """The variances of R that an estimate starts from, shape (m,), or None."""
        return None if self.noise_memory is None else np.diag(self.whole.R).copy()

    @property
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
        found, m = names_by_model(self.model), self.model.output_names
        n = self._all_names
        if n or m:
            found |= {"predicted_state": (n,), "predicted_covariance": (n, n), "gain": (n, m)}
        return found

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
        n, m = self.whole.states, self.whole.outputs
        posterior = Gaussian(
            as_vector("mean", mean, n), as_covariance("covariance", covariance, n), np.zeros(m)
        )
        before = sample_before(u, m, self.whole.inputs)
        return KalmanState(posterior, before, noise=self._start_noise)

    def predict(self, posterior: Gaussian, u: ArrayLike = ()) -> Gaussian:
        """Time update with the input that is held over the step, shape (p,).

        Gadsden et al. 2011, (11) and (12).

        Raises
        ------
        InputError
            If the input or the posterior has another size, or a Python function returns other
            shapes.
        DivergenceError
            If the result is not finite; its time counts from there.
        """
        n, m = self.whole.states, self.whole.outputs
        posterior = check_posterior("posterior", posterior, n, m)
        control = as_vector("u", u, self.whole.inputs)
        model, inputs, _ = self._in_record({}, np.empty((1, m)), np.array([[control, control]]))
        mean, covariances, work = np.empty((1, n)), np.empty((2, 1, n, n)), self._work()
        with RaisedAfterLoop():
            good = self.steps.predict(
                model, self.method, inputs[0], for_loop(posterior.mean)[None],
                for_loop(posterior.covariance)[None], mean, *covariances, work,
            )  # fmt: skip
        if not good:
            cause = int(work.cause[0]) if hasattr(work, "cause") else 0
            raise DivergenceError(type(self).__name__, 0.0, self.steps.causes.get(cause, ""))
        return Gaussian(mean[0], covariances[0, 0], posterior.error)

    def correct(self, posterior: Gaussian, y: ArrayLike, u: ArrayLike = ()) -> Correction:
        """Measurement update of a predicted posterior (Gadsden et al. 2011, (13) to (19)).

        Raises
        ------
        InputError
            If y (nan: missing), its input or the posterior has another size, or a Python function
            returns other shapes.
        DivergenceError
            If the covariance of the innovation is not positive definite, or the posterior leaves
            the range of floating-point numbers; its time counts from there.
        """
        n, m = self.whole.states, self.whole.outputs
        taken = as_samples("y", as_row("y", y), m, missing=True)[0]
        control = as_vector("u", u, self.whole.inputs)
        posterior = check_posterior("posterior", posterior, n, m)
        if np.isnan(taken).all():
            return Correction(posterior, np.full(m, np.nan), np.full((m, m), np.nan), 0.0)
        model, inputs, _ = self._in_record({}, taken[None], np.array([[control, control]]))
        after = self._posteriors([KalmanState(posterior, noise=self._start_noise)])
        rows, _, ends = self._filtered(model, inputs, taken[None, None], True, after)
        if not ends[0, 0]:
            raise DivergenceError(type(self).__name__, 0.0, self.steps.causes.get(ends[0, 1], ""))
        return Correction(
            Gaussian(*(part[0] for part in after[:3])), rows.innovation[0, 0],
            rows.innovation_covariance[0, 0], float(rows.log_likelihood[0, 0]),
        )  # fmt: skip

    def innovation_deviation(self, state: KalmanState) -> Array:
        """The standard deviations of the next row's innovation, shape (m,), if the model is right.

        It raises what `predict` and `correct` do.
        """
        ahead = self.predict(self._checked(state).posterior, np.zeros(self.inputs))
        one = self.correct(ahead, np.zeros(self.measurements), np.zeros(self.inputs))
        return np.sqrt(np.diag(one.innovation_covariance))

    def _given(self, given: Mapping[str, Any], rows: int) -> Mapping[str, Any]:
        """The values given by name for k rows, for the model of all that is estimated."""
        return given

    def _in_record(
        self, given: Mapping[str, Any], y: Array, inputs: Array, held: Matrices | None = None,
        periods: Array | None = None,
    ) -> InRecord:  # fmt: skip
        """The model over the rows of a record. ``periods`` lead to each of them, shape (k + 1,)."""
        return self.steps.in_record(self, given, y, inputs, held or {}, periods)

    def _timed(
        self, time: ArrayLike | None, state: KalmanState, record: Record
    ) -> tuple[Array, Record]:
        """The times of the rows, even or as the model can follow them."""
        if time is None and not record.given and state.held is None:
            return super()._timed(time, state, record)
        found = uneven_times(self.whole, time, state, record)
        return super()._timed(time, state, record) if found is None else found

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

        def block(one: slice) -> None:
            parts = [None if all_ is None else part(all_, one) for all_ in (after, rows, kept)]
            work = self._work()
            with RaisedAfterLoop():
                self.steps.run(model, method, y[one], inputs[one], fresh, *parts, work, ends[one])

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

    @cached_property
    def _spare(self) -> list[Any]:
        """Scratch that no thread uses at the moment."""
        return []

    def _named(
        self, rows: FilterRows, kept: PredictedRows | None, keep: Sequence[str]
    ) -> dict[str, Array]:
        """The estimates by their names."""
        state, covariance, innovation, innovation_covariance, log_likelihood = rows[:5]
        found = {
            "state": state,
            "variance": covariance.diagonal(axis1=-2, axis2=-1),
            "covariance": covariance,
            "innovation": innovation,
            "innovation_covariance": innovation_covariance,
            "log_likelihood": log_likelihood,
        }
        if self.gate is not None:
            found["outlier"] = rows.outlier
        if self.noise_memory is not None:
            found["noise_variance"] = rows.noise_variance
        return found | {name: getattr(kept, name) for name in keep} if keep else found

    def _kept(self, given: Mapping[str, Any]) -> Sequence[str]:
        """Names of what else the run shall hold."""
        names = given.get("keep", ())
        names = tuple(names) if isinstance(names, list | tuple) else (names,)
        for name in names:
            if not isinstance(name, str) or name not in self.keeps:
                raise InputError("keep", f"{shown(name)} must be one of {', '.join(self.keeps)}")
        return names

    def _fill(self, state: KalmanState, record: Record) -> Rows:
        given = self._given(record.given, len(record.y)) if record.given else record.given
        keep = self._kept(given) if given else ()
        if "R" in given and self.noise_memory is not None:
            raise InputError("R", "must be left out: noise_memory says that it is estimated")
        y, posterior, fresh = record.y, state.posterior, state.sample is None
        model, inputs, held = self._in_record(
            given, y, inputs_of_rows(state.sample, record)[None], state.held, record.periods
        )  # fmt: skip
        after = self._posteriors([state])
        rows, kept, ends = self._filtered(model, inputs, y[None], fresh, after, keep)
        found = self._named(
            FilterRows(*[one[0] for one in rows]),
            None if kept is None else PredictedRows(kept[0][0], kept[1][0], kept[2][0]), keep,
        )  # fmt: skip
        last = reached(after, 0, state, record, held, self._sizes)
        good, cause = ends[0].tolist()
        n, _, m = self._sizes
        if state.count <= n and n * m > 1:  # of one number Joseph's form loses nothing
            P, S = (one[0, : min(good, n + 1)] for one in rows[1:4:2])
            warn_of_start(posterior.covariance.diagonal(), P.diagonal(0, 1, 2), 5, S)
        return Rows(found, good, last, finding=self.steps.causes[cause] if cause else "")

    def _posteriors(self, states: Sequence[KalmanState]) -> FilterPosteriors:
        """Copies of what the states hold, which the loops move."""
        posteriors = [state.posterior for state in states]
        learned = self.noise_memory is not None
        return FilterPosteriors(
            np.array([one.mean for one in posteriors]),
            np.array([one.covariance for one in posteriors]),
            np.array([one.error for one in posteriors]),
            np.array([one.noise for one in states]) if learned else np.empty((len(states), 1)),
            np.array([float(one.count + (one.sample is not None)) for one in states]),
        )

    @cached_property
    def _sizes(self) -> tuple[int, int, int]:
        return self.whole.states, self.whole.inputs, self.whole.outputs

    def _checked(self, state: Any) -> KalmanState:
        checked = type(state) is KalmanState and vars(state).get("checked") == self._sizes
        if checked and (state.noise is None) is (self.noise_memory is None):
            check_held(state.held, self)  # which may be of a model with other parameters
            return state
        given = check_state(state, KalmanState, "")
        n, p, m = self._sizes
        posterior = check_posterior("state.posterior", given.posterior, n, m)
        sample = check_sample(given.sample, m, p)
        noise = check_noise(given.noise, self.noise_memory is not None, m)
        held, time = check_held(given.held, self), check_time(given.time)
        same = posterior is given.posterior and sample is given.sample and noise is given.noise
        if same and held is None:
            return given
        return KalmanState(posterior, sample, given.count, held, time, noise)

    def _run_records(self, records: Sequence[Record], states: Sequence[KalmanState]) -> Many:
        first, one = states[0], records[0]
        alike = all(
            (state.sample is None) == (first.sample is None) and state.held is first.held is None
            for state in states
        )
        if not alike or one.periods is not None or "S" in one.given:
            return super()._run_records(records, states)  # what leads to each row differs
        given, fresh = self._given(one.given, len(one.y)), first.sample is None
        if "R" in given and self.noise_memory is not None:
            raise InputError("R", "must be left out: noise_memory says that it is estimated")
        pairs = zip(states, records, strict=True)
        inputs = np.array([inputs_of_rows(state.sample, record) for state, record in pairs])
        y = np.array([record.y for record in records])
        model, inputs, held = self._in_record(given, y[0], inputs)
        keep = self._kept(given) if given else ()
        after = self._posteriors(states)
        starts = after.covariances.diagonal(0, 1, 2).copy()
        rows, kept, ends = self._filtered(model, inputs, y, fresh, after, keep)
        n, _, m = self._sizes
        if first.count <= n and n * m > 1:
            P, S = (one[:, : n + 1] for one in rows[1:4:2])
            warn_of_starts(starts, P.diagonal(0, 2, 3), ends[:, 0], S)
        causes = self.steps.causes
        return Many(
            self._named(rows, kept, keep), {}, ends[:, 0].tolist(),
            [reached(after, r, states[r], records[r], held, self._sizes) for r in range(len(y))],
            [causes[cause] if cause else "" for cause in ends[:, 1].tolist()],
        )  # fmt: skip
