"""What filters on nonlinear models share.

The first row of a record corrects the belief that `init` was given; before each later row the
filter predicts with the input of the row before, and it corrects with the input of the row itself.
`predict` and `correct` are the two halves, so that such filters can be modes of an `IMM`.

A nan in a row of measurements stands for a number that was not measured, as in
`reobserve.observers.linear_filter`.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import DivergenceError, InputError, shown
from reobserve.core.matrices import as_floats, as_row, as_samples, as_vector
from reobserve.core.value import Value, for_loop
from reobserve.observers.contract import Observer, OnDivergence, Record, Rows, check_state
from reobserve.observers.fixed_step import Pair
from reobserve.observers.linear_filter import (
    Belief,
    Correction,
    check_belief,
    check_sample,
    copies,
    inputs_of_rows,
    sample_before,
)
from reobserve.observers.nonlinear_filter_loop import (
    correct,
    predict,
    run_filter,
    write_innovation_covariance,
)
from reobserve.observers.nonlinear_filter_work import (
    NO_BELIEF,
    NO_INNOVATION,
    NO_OUTPUT,
    NO_ROOT,
    NO_STATE,
    new_filter_work,
)
from reobserve.observers.run import Estimate, Run
from reobserve.observers.unscented_kalman_loop import Weights
from reobserve.systems.linear import as_covariance
from reobserve.systems.nonlinear import NonlinearModel
from reobserve.systems.nonlinear_flow import Functions

Array = NDArray[np.float64]

CAUSES = {
    NO_STATE: "f, or the covariance after it, is not finite at the next sample",
    NO_OUTPUT: "h is not finite at the next sample",
    NO_INNOVATION: "the covariance of the next innovation is not finite and positive definite",
    NO_ROOT: "the covariance of the state is no longer positive semidefinite, so that it has no "
    "Cholesky factor",
    NO_BELIEF: "the next correction is not finite",
}


@dataclass(frozen=True, eq=False, repr=False)
class State(Value):
    """All a filter remembers: a value that may be stored, copied and stepped again.

    ``sample`` and ``count`` are as in `reobserve.observers.contract.ObserverState`; y may be nan.
    ``process_noise`` is Q from that sample on, shape (n, n), or None for the model's.
    """

    belief: Belief
    sample: Array | None = None
    count: int = 0
    process_noise: Array | None = None


@dataclass(frozen=True)
class _Noise:
    """Q and R of each row of a record, shapes (k, n, n) and (k, m, m); one of each may do."""

    Q: Array
    R: Array


@dataclass(frozen=True, eq=False, repr=False)
class NonlinearFilter(Observer[State]):
    """A filter on a nonlinear model; what derives from it says how it moves covariances.

    Its estimates are ``state``, shape (k, n), and ``covariance``, (k, n, n), with ``variance``,
    (k, n), on its diagonal, after each measurement; ``innovation``, (k, m), and
    ``innovation_covariance``, (k, m, m), nan where a measurement is missing; and
    ``log_likelihood``, (k,), of the measurement, zero where all of it is missing.

    Parameters
    ----------
    model
        The model that it trusts, whose sampling period is the filter's.

    Raises
    ------
    InputError
        If it is no nonlinear model.
    """

    model: NonlinearModel
    sampling_period: float = field(init=False)

    reads_between: ClassVar[bool] = False
    reads_missing: ClassVar[bool] = True
    units: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("state", "variance", "covariance", "innovation", "innovation_covariance",
         "log_likelihood"), "",
    )  # fmt: skip

    def __post_init__(self) -> None:
        period = as_kind("model", self.model, NonlinearModel).sampling_period
        object.__setattr__(self, "sampling_period", period)

    @property
    def measurements(self) -> int:
        """How many numbers a row of y has."""
        return self.model.outputs

    @property
    def inputs(self) -> int:
        """How many numbers a row of u has."""
        return self.model.inputs

    @property
    def weights(self) -> Weights | None:
        """Those of sigma points; None of the extended filter."""
        raise NotImplementedError

    @property
    def functions(self) -> Functions:
        """The model as the loop reads it."""
        return self.model.functions

    @cached_property
    def _sizes(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        return (0,) * self.model.states, (0,) * self.model.outputs

    def init(self, mean: ArrayLike, covariance: ArrayLike, *, u: ArrayLike | None = None) -> State:
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
        belief = Belief(
            as_vector("mean", mean, self.model.states),
            as_covariance("covariance", covariance, self.model.states),
            np.zeros(self.model.outputs),
        )
        return State(belief, sample_before(u, self.model.outputs, self.model.inputs))

    def step(
        self,
        state: State,
        y: ArrayLike,
        u: ArrayLike | None = None,
        *,
        Q: ArrayLike | None = None,
        R: ArrayLike | None = None,
        before: Pair | None = None,
        middle: Pair | None = None,
    ) -> tuple[State, Estimate]:
        """Take one sample: the next state, and the estimates at it.

        The arguments are those of `run`, without the axis of samples. Stepping through a record
        gives bitwise what `run` gives.

        Raises
        ------
        InputError
            As `run`.
        DivergenceError
            As `run`.
        """
        return Observer.step(self._with_noise(Q, R, 1), state, y, u, before=before, middle=middle)

    def run(
        self,
        y: ArrayLike,
        u: ArrayLike | None = None,
        *,
        state: State | None = None,
        time: ArrayLike | None = None,
        Q: ArrayLike | None = None,
        R: ArrayLike | None = None,
        before: Pair | None = None,
        middle: Pair | None = None,
        on_divergence: OnDivergence = "raise",
    ) -> Run[State]:
        """Estimates at all samples of a record, by one compiled loop.

        Parameters
        ----------
        y
            Measurements, shape (k, m), or (k,) where m is 1; nan where one is missing.
        u
            Known inputs, shape (k, p), or (k,); left out where there are none.
        state
            From `init`, or from an earlier run or step to go on with the sample after its last.
        time
            Of the samples [s], shape (k,), a sampling period apart; left out, it counts from 0 or
            goes on from the state.
        Q
            Covariance of the process noise in place of the model's: as there, or one for each row,
            shape (k, n, n). That of a row drives the step to the next one.
        R
            Covariance of the measurement noise in place of the model's: as there, or one for each
            row, shape (k, m, m).
        before, middle
            To be left out: nothing between samples is read.
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `Run.diverged_at`.

        Raises
        ------
        InputError
            If a shape is wrong, a number is not finite, the times are not a sampling period apart,
            the state is of another observer, or a Python function returns other shapes or raises.
        DivergenceError
            If f, h or the estimates are not finite, or a covariance is not positive definite; it
            gives the time and says which.
        """
        changed = Q is not None or R is not None
        rows = len(self._read_measurements("y", y)) if changed else 0
        return Observer.run(
            self._with_noise(Q, R, rows), y, u, state=state, time=time, before=before,
            middle=middle, on_divergence=on_divergence,
        )  # fmt: skip

    def predict(self, belief: Belief, u: ArrayLike = ()) -> Belief:
        """Time update with the input u of the sample that the belief is of, shape (p,).

        Raises
        ------
        InputError
            If the input or the belief has another size, or a Python function returns other shapes.
        DivergenceError
            If the result is not finite or the covariance has no root; its time counts from there.
        """
        states, outputs = self._sizes
        belief = check_belief("belief", belief, len(states), len(outputs))
        mean, covariance = np.empty_like(belief.mean), np.empty_like(belief.covariance)
        work = new_filter_work(len(states), len(outputs))
        good = predict(
            states, self.functions, self.weights, self.model.Q,
            as_vector("u", u, self.model.inputs), for_loop(belief.mean),
            for_loop(belief.covariance), mean, covariance, work,
        )  # fmt: skip
        self.model.raise_problem()
        if not good:
            raise DivergenceError(type(self).__name__, 0.0, CAUSES[int(work.cause[0])])
        return Belief(mean, covariance, belief.error)

    def correct(self, belief: Belief, y: ArrayLike, u: ArrayLike = ()) -> Correction:
        """Measurement update of a predicted belief; y and u are of the same sample.

        Raises
        ------
        InputError
            If y (nan: missing), u or the belief has another size, or a Python function returns
            other shapes.
        DivergenceError
            If the covariance of the innovation is not positive definite, or a result is not
            finite; its time counts from there.
        """
        states, outputs = self._sizes
        n, m = len(states), len(outputs)
        taken = as_samples("y", as_row("y", y), m, missing=True)[0]
        control = as_vector("u", u, self.model.inputs)
        belief = check_belief("belief", belief, n, m)
        innovation, spread = np.full(m, np.nan), np.full((m, m), np.nan)
        if np.isnan(taken).all():
            return Correction(belief, innovation, spread, 0.0)
        after = copies(belief)
        factor, work = np.empty((m, m)), new_filter_work(n, m)
        log_likelihood = correct(
            states, outputs, self.functions, self.weights, self.model.R, taken, control,
            after[0], after[1], innovation, factor, work,
        )  # fmt: skip
        self.model.raise_problem()
        if np.isnan(log_likelihood):
            raise DivergenceError(type(self).__name__, 0.0, CAUSES[int(work.cause[0])])
        write_innovation_covariance(innovation, factor, spread)
        return Correction(Belief(*after), innovation, spread, log_likelihood)

    @property
    def _noise(self) -> _Noise:
        """The noise of the record in hand: the model's, unless `_with_noise` put another there."""
        return vars(self).get("_given_noise") or _Noise(self.model.Q[None], self.model.R[None])

    def _with_noise(self, Q: ArrayLike | None, R: ArrayLike | None, rows: int) -> NonlinearFilter:
        """The same filter with other noise, for one record."""
        if Q is None and R is None:
            return self
        own = self._noise
        other = copy(self)
        noise = _Noise(
            own.Q if Q is None else as_covariances("Q", Q, self.model.states, rows),
            own.R if R is None else as_covariances("R", R, self.model.outputs, rows, definite=True),
        )
        object.__setattr__(other, "_given_noise", noise)
        return other

    def _checked(self, state: Any) -> State:
        given = check_state(state, State, "")
        n, p, m = self.model.states, self.model.inputs, self.model.outputs
        belief = check_belief("state.belief", given.belief, n, m)
        sample, noise = check_sample(given.sample, m, p), given.process_noise
        if noise is not None:
            noise = as_covariance("state.process_noise", noise, n)
        elif belief is given.belief and sample is given.sample:
            return given
        return State(belief, sample, given.count, noise)

    def _fill(self, state: State, record: Record) -> Rows:
        return self._filtered(state, record)[0]

    def _finding(self, state: State, record: Record, good: int, first: float) -> str:
        return CAUSES.get(self._filtered(state, record)[1], "")

    def _filtered(self, state: State, record: Record) -> tuple[Rows, int]:
        """The rows, and why the loop stopped, a key of `CAUSES`, or 0."""
        states, outputs = self._sizes
        n, m, k = len(states), len(outputs), len(record.y)
        after, fresh, noise = copies(state.belief), state.sample is None, self._noise
        held = self.model.Q if state.process_noise is None else state.process_noise
        means, covariances = np.empty((k, n)), np.empty((k, n, n))
        innovations, spreads = np.empty((k, m)), np.empty((k, m, m))
        log_likelihoods = np.empty(k)
        good, cause = run_filter(
            states, outputs, self.functions, self.weights, np.concatenate([held[None], noise.Q]),
            noise.R, record.y, inputs_of_rows(state.sample, record), fresh, after[0],
            after[1], means, covariances, innovations, spreads, log_likelihoods,
            np.empty((m, m)), new_filter_work(n, m),
        )  # fmt: skip
        self.model.raise_problem()
        estimates = {
            "state": means,
            "variance": covariances.diagonal(axis1=1, axis2=2),
            "covariance": covariances,
            "innovation": innovations,
            "innovation_covariance": spreads,
            "log_likelihood": log_likelihoods,
        }
        sample = np.concatenate([record.y[-1], record.u[-1]])
        kept = None if "_given_noise" not in vars(self) else noise.Q[-1]
        return Rows(
            estimates, good, State(Belief(*after), sample, state.count + k - fresh, kept)
        ), cause


def as_covariances(
    name: str, value: ArrayLike, size: int, rows: int, *, definite: bool = False
) -> Array:
    """A covariance as `as_covariance` makes it, shape (1, n, n), or one for each row, (k, n, n).

    Raises
    ------
    InputError
        If it is neither; it names the first row that is not symmetric positive (semi)definite.
    """
    array = as_floats(name, value)
    if array.ndim != 3:
        return as_covariance(name, array, size, definite=definite)[None]
    if array.shape != (rows, size, size):
        wanted = (rows, size, size)
        raise InputError(name, f"has shape {array.shape}, must be one covariance or {wanted}")
    eigenvalues = np.linalg.eigvalsh(array)
    least = np.zeros(rows) if definite else -1e-12 * np.maximum(eigenvalues[:, -1], 0.0)
    low = eigenvalues[:, 0] <= 0 if definite else eigenvalues[:, 0] < least
    for row in np.flatnonzero(low | (array != array.transpose(0, 2, 1)).any(axis=(1, 2))):
        as_covariance(f"{name}[{row}]", array[row], size, definite=definite)
        raise InputError(f"{name}[{row}]", f"{shown(array[row].tolist())} is no covariance")
    return np.ascontiguousarray(array)
