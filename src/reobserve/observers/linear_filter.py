"""Filters that correct a linear prediction by a gain: the Kalman filter, the SVSF, fixed gains.

A filter holds a `LinearModel` and a law for its gain. What it holds to be true is a `Belief`. The
first row of a record corrects the one that `init` was given; before each later row the filter
predicts with the input of the row before, and corrects with that of the row itself. `predict` and
`correct` are the two halves, which a bank of filters calls one by one.

A nan in a row of measurements stands for a number that was not measured: its innovation is nan, and
the run counts such rows. The other numbers of the row correct as if they alone were measured; over
a row of nothing but nan the filter predicts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import DivergenceError, InputError, shown
from reobserve.core.kernel import Law
from reobserve.core.matrices import all_finite, as_numbers, as_row, as_samples, as_vector
from reobserve.core.value import Value, for_loop
from reobserve.observers.contract import Observer, Record, Rows, check_state
from reobserve.observers.linear_filter_loop import (
    correct,
    is_missing,
    new_work,
    predict,
    run_filter,
)
from reobserve.systems.linear import LinearModel, as_covariance

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Belief(Value):
    """What a filter holds to be true: a value that may be stored, copied and used again.

    ``mean``, shape (n,), and ``covariance``, (n, n), of the state; ``error`` is the filter's own a
    posteriori output error e(k|k) of (18), shape (m,), which the SVSF needs a sample later.
    """

    mean: Array
    covariance: Array
    error: Array


@dataclass(frozen=True, eq=False, repr=False)
class State(Value):
    """All a filter remembers: a value that may be stored, copied and stepped again.

    ``sample`` and ``count`` are as in `reobserve.observers.contract.ObserverState`; y may be nan.
    """

    belief: Belief
    sample: Array | None = None
    count: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class Correction(Value):
    """A belief after a measurement, and how well that was foretold.

    ``innovation`` e(k+1|k), shape (m,), its ``innovation_covariance`` S, shape (m, m), and the
    ``log_likelihood`` of the measurement. What of it is missing has nan in the first two; where all
    is, the third is zero.
    """

    belief: Belief
    innovation: Array
    innovation_covariance: Array
    log_likelihood: float


class ModeFilter(Protocol):
    """What an interacting multiple model asks of a filter, one of ours or a user's own."""

    @property
    def model(self) -> Any:
        """What has ``states``, ``inputs`` and ``outputs``, numbers, and a ``sampling_period``."""

    def predict(self, belief: Belief, u: Array) -> Belief:
        """The belief a sample later, before its measurement; u is held over the step."""

    def correct(self, belief: Belief, y: Array, u: Array) -> Correction:
        """The predicted belief after y, measured with the input u; a nan in y is missing."""


@dataclass(frozen=True, eq=False, repr=False)
class LinearFilter(Observer[State]):
    """A filter on a linear model; what derives from it says what its gain is.

    Its estimates are ``state``, shape (k, n), and ``variance``, (k, n), mean and diagonal of the
    covariance after each measurement; ``innovation``, (k, m), what was not foretold of it, nan
    where it is missing; and ``log_likelihood``, (k,), of the measurement, zero where it is missing.

    Parameters
    ----------
    model
        The linear model that it trusts, whose sampling period is the filter's.

    Raises
    ------
    InputError
        If it is no linear model.
    """

    model: LinearModel
    sampling_period: float = field(init=False)

    reads_between: ClassVar[bool] = False
    reads_missing: ClassVar[bool] = True
    units: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("state", "variance", "innovation", "log_likelihood"), ""
    )

    def __post_init__(self) -> None:
        period = as_kind("model", self.model, LinearModel).sampling_period
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
    def law(self) -> Law | None:
        """The law of the gain, made by `gain_law`; None for Kalman's, which the loop knows."""
        raise NotImplementedError

    @property
    def compiled_law(self) -> Any:
        """The law as the loop is handed it."""
        return None if self.law is None else self.law.compiled

    @property
    def law_parameters(self) -> Array:
        """What the law gets as its parameters."""
        return np.empty(0)

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

    def innovation_deviation(self, state: State) -> Array:
        """The standard deviations of the next row's innovation, shape (m,), if the model is right.

        Raises
        ------
        InputError
            If the state is not one of this filter.
        DivergenceError
            As `predict` and `correct`.
        """
        ahead = self.predict(self._checked(state).belief, np.zeros(self.inputs))
        one = self.correct(ahead, np.zeros(self.measurements), np.zeros(self.inputs))
        return np.sqrt(np.diag(one.innovation_covariance))

    def predict(self, belief: Belief, u: ArrayLike = ()) -> Belief:
        """Time update with the input that is held over the step, shape (p,).

        Gadsden et al. 2011, (11) and (12).

        Raises
        ------
        InputError
            If the input or the belief has another size.
        DivergenceError
            If the belief leaves the range of floating-point numbers; its time counts from there.
        """
        states, outputs = self._sizes
        belief = check_belief("belief", belief, len(states), len(outputs))
        mean, covariance = np.empty_like(belief.mean), np.empty_like(belief.covariance)
        predict(
            states, self.model.arrays, as_vector("u", u, self.model.inputs),
            for_loop(belief.mean), for_loop(belief.covariance), mean, covariance,
            new_work(len(states), len(outputs)),
        )  # fmt: skip
        return self._finite(Belief(mean, covariance, belief.error))

    def correct(self, belief: Belief, y: ArrayLike, u: ArrayLike = ()) -> Correction:
        """Measurement update of a predicted belief (Gadsden et al. 2011, (13) to (19)).

        Raises
        ------
        InputError
            If y (nan: missing), its input or the belief has another size.
        DivergenceError
            If the covariance of the innovation is not positive definite, or the belief leaves the
            range of floating-point numbers; its time counts from there.
        """
        taken = as_samples("y", as_row("y", y), self.model.outputs, missing=True)[0]
        control = as_vector("u", u, self.model.inputs)
        states, outputs = self._sizes
        m = len(outputs)
        belief = check_belief("belief", belief, len(states), m)
        innovation, factor = np.full(m, np.nan), np.full((m, m), np.nan)
        if is_missing(taken):
            return Correction(belief, innovation, factor, 0.0)
        after = copies(belief)
        log_likelihood = correct(
            states, outputs, self.model.arrays, self.compiled_law, self.law_parameters, taken,
            control, *after, innovation, factor, new_work(len(states), m),
        )  # fmt: skip
        corrected = self._finite(Belief(*after), log_likelihood)
        innovation_covariance, lost = factor @ factor.T, np.isnan(innovation)
        innovation_covariance[lost] = innovation_covariance[:, lost] = np.nan
        return Correction(corrected, innovation, innovation_covariance, log_likelihood)

    def _finite(self, belief: Belief, log_likelihood: float = 0.0) -> Belief:
        if not np.isfinite(log_likelihood + belief.mean.sum() + np.trace(belief.covariance)):
            raise DivergenceError(type(self).__name__, 0.0)
        return belief

    def _checked(self, state: Any) -> State:
        given = check_state(state, State, "")
        n, p, m = self.model.states, self.model.inputs, self.model.outputs
        belief = check_belief("state.belief", given.belief, n, m)
        sample = check_sample(given.sample, m, p)
        if belief is given.belief and sample is given.sample:
            return given
        return State(belief, sample, given.count)

    def _fill(self, state: State, record: Record) -> Rows:
        states, outputs = self._sizes
        n, m, k = len(states), len(outputs), len(record.y)
        after, fresh = copies(state.belief), state.sample is None
        means, variances = np.empty((k, n)), np.empty((k, n))
        innovations, log_likelihoods = np.empty((k, m)), np.empty(k)
        good = run_filter(
            states, outputs, self.model.arrays, self.compiled_law, self.law_parameters, record.y,
            inputs_of_rows(state.sample, record), fresh, *after,
            means, variances, innovations, log_likelihoods,
        )  # fmt: skip
        estimates = {
            "state": means,
            "variance": variances,
            "innovation": innovations,
            "log_likelihood": log_likelihoods,
        }
        last = np.concatenate([record.y[-1], record.u[-1]])
        return Rows(estimates, good, State(Belief(*after), last, state.count + k - fresh))


def copies(belief: Belief) -> tuple[Array, Array, Array]:
    """The arrays of a belief, for a loop to work in."""
    return belief.mean.copy(), belief.covariance.copy(), belief.error.copy()


def inputs_of_rows(sample: Array | None, record: Record) -> Array:
    """The input of the row before a record, then that of each row, shape (k + 1, p).

    The first row of all has none before it; its own stands there, and is not read.
    """
    first = record.u[0] if sample is None else sample[record.y.shape[1] :]
    return np.concatenate([first[None], record.u])


def sample_before(u: ArrayLike | None, outputs: int, inputs: int) -> Array | None:
    """The sample of a state that stands a period before its first row; None if it does not.

    Raises
    ------
    InputError
        If u is not so many finite numbers.
    """
    if u is None:
        return None
    held = as_samples("u", as_row("u", u), inputs)[0]
    return np.concatenate([np.full(outputs, np.nan), held])


def check_belief(name: str, belief: Belief, states: int, outputs: int) -> Belief:
    """The belief, of this size: compiled loops would read beyond its end.

    Raises
    ------
    InputError
        If it is of another size, or not finite.
    """
    shapes = [
        getattr(getattr(belief, part, None), "shape", ())
        for part in ("mean", "covariance", "error")
    ]
    return check_state(
        belief, Belief,
        f"has arrays of shapes {tuple(shapes)}, must be of {states} states, {outputs} outputs",
        name, mean=(states,), covariance=(states, states), error=(outputs,),
    )  # fmt: skip


def check_sample(value: Any, outputs: int, inputs: int) -> Array | None:
    """The sample of a state: y, of which any may be nan, and u.

    Raises
    ------
    InputError
        If it is of another size, or u is not finite.
    """
    if value is None:
        return None
    sample = as_numbers("state.sample", value, writable=False)
    if sample.shape != (outputs + inputs,) or not all_finite(sample[outputs:]):
        problem = f"{shown(value)} must be {outputs} measurements and {inputs} finite inputs"
        raise InputError("state.sample", problem)
    return sample
