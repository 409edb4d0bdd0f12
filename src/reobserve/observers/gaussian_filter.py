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
from reobserve.core.errors import InputError, shown
from reobserve.core.loop_function import RaisedAfterLoop
from reobserve.core.matrices import as_positive, as_vector
from reobserve.observers import filter_halves
from reobserve.observers.batch_run import in_threads, part
from reobserve.observers.contract import Observer
from reobserve.observers.estimated_noise import check_noise_memory, refuse_given
from reobserve.observers.filter_records import can_run_together, posteriors_of, run_together
from reobserve.observers.filter_rules import Rules, forgetting
from reobserve.observers.gaussian_state import (
    Correction,
    FilterSteps,
    Gaussian,
    InRecord,
    KalmanState,
    Matrices,
    check_held,
    check_noise,
    check_posterior,
    check_sample,
    check_time,
    inputs_of_rows,
    periods_of,
    reached,
    sample_before,
)
from reobserve.observers.linear_loop import FilterPosteriors, FilterRows, PredictedRows
from reobserve.observers.record import Batch, Record, Rows, check_state
from reobserve.observers.run import AxisNames, names_by_model
from reobserve.observers.uneven_times import uneven_hint, uneven_times
from reobserve.observers.vague_start import warn_of_start
from reobserve.systems.periods import wrapped

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
        the process noise from a row on with the measurement noise of that row; without a ``gate``.
    parameters, dt
        Of a nonlinear model: values of parameters by name, numbers or (k,); and the time [s] from
        each row to the next one, (k,), which a model from `from_ode` takes. More than a sampling
        period is predicted in equal parts; Q by row is added in the last of them.
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
        How many standard deviations an innovation may have, each output for itself. A fault that
        looks like outliers is rejected with them, so look at ``outlier``.
    outliers
        ``skip``: they count as missing; or ``inflate``: their variance of noise is raised so far
        that they are at the gate.
    noise_memory
        [s], of rows a sampling period apart. The diagonal of R is estimated, from that of the model
        on: R <- R + g diag(R S^-1 (e e' - S) S^-1 R), with the weight g = max(T / memory,
        1 / (k + 20)) of row k, expectation maximisation that forgets (Shumway & Stoffer 1982).

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
        return Rules(
            *periods_of(self), np.inf if self.gate is None else self.gate,
            self.outliers == "inflate", forgetting(self.noise_memory, self.sampling_period),
        )  # fmt: skip

    @property
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
        n, m = self.whole.states, self.whole.outputs
        posterior = Gaussian(
            as_vector("mean", mean, n), as_covariance("covariance", covariance, n), np.zeros(m)
        )
        posterior = posterior._with(mean=wrapped(posterior.mean, periods_of(self)[0]))
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
        return filter_halves.predict(self, posterior, u)

    def correct(self, posterior: Gaussian, y: ArrayLike, u: ArrayLike = ()) -> Correction:
        """Measurement update of a predicted posterior (Gadsden et al. 2011, (13) to (19)).

        Raises
        ------
        InputError
            If y (nan: missing), its input or the posterior has another size, or a Python function
            returns other shapes.
        DivergenceError
            If the covariance of the innovation is not positive definite, the posterior leaves the
            range of floating-point numbers, or rounding makes a variance negative; its time counts
            from there.
        """
        return filter_halves.correct(self, posterior, y, u)

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
        plain = time is None and not record.given and state.held is None
        if plain or self.noise_memory is not None:  # which counts sampling periods
            return super()._timed(time, state, record)
        timed = uneven_times(self.whole, time, state, record)
        return super()._timed(time, state, record) if timed is None else timed

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
        given = self._given(record.given, len(record.y)) if record.given else record.given
        keep = self._names_to_keep(given) if given else ()
        refuse_given(self, given)
        y, posterior, fresh = record.y, state.posterior, state.sample is None
        model, inputs, held = self._in_record(
            given, y, inputs_of_rows(state.sample, record)[None], state.held, record.periods
        )  # fmt: skip
        after = posteriors_of(self, [state])
        rows, kept, ends = self._filtered(model, inputs, y[None], fresh, after, keep)
        estimates = self._by_name(
            FilterRows(*[array[0] for array in rows]),
            None if kept is None else PredictedRows(kept[0][0], kept[1][0], kept[2][0]), keep,
        )  # fmt: skip
        last = reached(after, 0, state, record, held, self._sizes)
        good, cause = ends[0].tolist()
        n, _, m = self._sizes
        if state.count <= n and n * m > 1:  # of one number Joseph's form loses nothing
            P, S = (array[0, : min(good, n + 1)] for array in rows[1:4:2])
            warn_of_start(posterior.covariance.diagonal(), P.diagonal(0, 1, 2), 5, S)
        return Rows(estimates, good, last, finding=self.steps.causes[cause] if cause else "")

    @cached_property
    def _sizes(self) -> tuple[int, int, int]:
        return self.whole.states, self.whole.inputs, self.whole.outputs

    def _checked(self, state: Any) -> KalmanState:
        checked = type(state) is KalmanState and vars(state).get("checked") == self._sizes
        if checked and (state.noise is None) is (self.noise_memory is None):
            check_held(state.held, self)  # which may be of a model with other parameters
            return state  # type: ignore[no-any-return]
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

    def _run_records(self, records: Sequence[Record], states: Sequence[KalmanState]) -> Batch:
        if can_run_together(records, states):
            return run_together(self, records, states)
        return super()._run_records(records, states)  # what leads to each row differs
