"""The base class of filters that estimate a state by its mean and covariance.

The first row of a record corrects the estimate that `init` was given; before each later row the
filter predicts with the input of the row before, and corrects with that of the row itself.

A nan in a row of measurements stands for a number that was not measured: its innovation is nan, and
the run counts such rows. The other numbers of the row correct as if they alone were measured; over
a row of nothing but nan the filter predicts.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import all_finite, as_floats, as_numbers, as_row, as_samples, as_vector
from reobserve.core.value import Value, for_loop
from reobserve.observers.contract import Observer, OnDivergence, Record, check_state
from reobserve.observers.fixed_step import Pair
from reobserve.observers.run import Estimate, Run
from reobserve.systems.linear import as_covariance

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Gaussian(Value):
    """Mean and covariance of the state as a filter estimates it.

    ``mean``, shape (n,), and ``covariance``, (n, n), of the state; ``error`` is the filter's own a
    posteriori output error e(k|k), shape (m,), which the SVSF needs a sample later.
    """

    mean: Array
    covariance: Array
    error: Array


@dataclass(frozen=True, eq=False, repr=False)
class KalmanState(Value):
    """All a filter remembers: a value that may be stored, copied and stepped again.

    ``sample`` and ``count`` are as in `reobserve.observers.contract.ObserverState`; y may be nan.
    ``process_noise`` is Q from that sample on, shape (n, n), or None for the model's.
    """

    posterior: Gaussian
    sample: Array | None = None
    count: int = 0
    process_noise: Array | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Correction(Value):
    """A posterior after a measurement, and how well it was predicted.

    ``innovation`` e(k+1|k), shape (m,), its ``innovation_covariance`` S, shape (m, m), and the
    ``log_likelihood`` of the measurement. What of it is missing has nan in the first two; where all
    is, the third is zero.
    """

    posterior: Gaussian
    innovation: Array
    innovation_covariance: Array
    log_likelihood: float


class ModeFilter(Protocol):
    """What an interacting multiple model asks of a filter, one of ours or a user's own."""

    @property
    def model(self) -> Any:
        """What has ``states``, ``inputs`` and ``outputs``, numbers, and a ``sampling_period``."""

    def predict(self, posterior: Gaussian, u: Array) -> Gaussian:
        """The posterior a sample later, before its measurement; u is held over the step."""

    def correct(self, posterior: Gaussian, y: Array, u: Array) -> Correction:
        """The predicted posterior after y, measured with the input u; a nan in y is missing."""


@dataclass(frozen=True)
class Noise:
    """Q and R of each row of a record, shapes (k, n, n) and (k, m, m); one of each may do."""

    Q: Array
    R: Array


class NoiseByRow(Observer[KalmanState]):
    """An observer that takes the covariances of its model's noise for each row of a record."""

    def step(
        self,
        state: KalmanState,
        y: ArrayLike,
        u: ArrayLike | None = None,
        *,
        Q: ArrayLike | None = None,
        R: ArrayLike | None = None,
        before: Pair | None = None,
        middle: Pair | None = None,
    ) -> tuple[KalmanState, Estimate]:
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
        state: KalmanState | None = None,
        time: ArrayLike | None = None,
        Q: ArrayLike | None = None,
        R: ArrayLike | None = None,
        before: Pair | None = None,
        middle: Pair | None = None,
        on_divergence: OnDivergence = "raise",
    ) -> Run[KalmanState]:
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
            the state is of another observer, or a Python function of a nonlinear model returns
            other shapes or raises.
        DivergenceError
            If an estimate is not finite, or a covariance is not positive definite; it gives the
            time.
        """
        changed = Q is not None or R is not None
        rows = len(self._read_measurements("y", y)) if changed else 0
        return Observer.run(
            self._with_noise(Q, R, rows), y, u, state=state, time=time, before=before,
            middle=middle, on_divergence=on_divergence,
        )  # fmt: skip

    def _with_noise(self, Q: ArrayLike | None, R: ArrayLike | None, rows: int) -> Self:
        """The same observer with other noise, for one record."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False, repr=False)
class GaussianFilter(NoiseByRow):
    """A filter of mean and covariance; what derives from it has a ``model`` with Q and R.

    Its estimates are ``state``, shape (k, n), and ``covariance``, (k, n, n), with ``variance``,
    (k, n), on its diagonal, after each measurement; ``innovation``, (k, m), and
    ``innovation_covariance``, (k, m, m), nan where a measurement is missing; and
    ``log_likelihood``, (k,), of the measurement, zero where all of it is missing.
    """

    model: Any
    sampling_period: float = field(init=False)

    reads_between: ClassVar[bool] = False
    reads_missing: ClassVar[bool] = True
    units: ClassVar[Mapping[str, str]] = dict.fromkeys(
        ("state", "variance", "covariance", "innovation", "innovation_covariance",
         "log_likelihood"), "",
    )  # fmt: skip

    @property
    def measurements(self) -> int:
        """How many numbers a row of y has."""
        return int(self.model.outputs)

    @property
    def inputs(self) -> int:
        """How many numbers a row of u has."""
        return int(self.model.inputs)

    @cached_property
    def _sizes(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Tuples as long as there are states and outputs, for which loops are compiled."""
        return (0,) * self.model.states, (0,) * self.model.outputs

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
        posterior = Gaussian(
            as_vector("mean", mean, self.model.states),
            as_covariance("covariance", covariance, self.model.states),
            np.zeros(self.model.outputs),
        )
        return KalmanState(posterior, sample_before(u, self.model.outputs, self.model.inputs))

    @property
    def _noise(self) -> Noise:
        """The noise of the record in hand: the model's, unless `_with_noise` put another there."""
        return vars(self).get("_given_noise") or Noise(
            for_loop(self.model.Q)[None], for_loop(self.model.R)[None]
        )

    def _with_noise(self, Q: ArrayLike | None, R: ArrayLike | None, rows: int) -> Self:
        """The same filter with other noise, for one record."""
        if Q is None and R is None:
            return self
        own = self._noise
        other = copy(self)
        noise = Noise(
            own.Q if Q is None else as_covariances("Q", Q, self.model.states, rows),
            own.R if R is None else as_covariances("R", R, self.model.outputs, rows, definite=True),
        )
        object.__setattr__(other, "_given_noise", noise)
        return other

    def _noise_of_rows(self, state: KalmanState) -> tuple[Array, Array]:
        """Q of the row before a record, then of its rows, and R of its rows, as loops read them."""
        held = self.model.Q if state.process_noise is None else state.process_noise
        return np.concatenate([held[None], self._noise.Q]), self._noise.R

    def _after(self, state: KalmanState, record: Record, posterior: Gaussian) -> KalmanState:
        """The state after a record that begins at another one."""
        sample, steps = np.concatenate([record.y[-1], record.u[-1]]), len(record.y)
        kept = None if "_given_noise" not in vars(self) else self._noise.Q[-1]
        return KalmanState(posterior, sample, state.count + steps - (state.sample is None), kept)

    def _checked(self, state: Any) -> KalmanState:
        given = check_state(state, KalmanState, "")
        n, p, m = self.model.states, self.model.inputs, self.model.outputs
        posterior = check_posterior("state.posterior", given.posterior, n, m)
        sample, noise = check_sample(given.sample, m, p), given.process_noise
        if noise is not None:
            noise = as_covariance("state.process_noise", noise, n)
        elif posterior is given.posterior and sample is given.sample:
            return given
        return KalmanState(posterior, sample, given.count, noise)


def new_rows(rows: int, states: int, outputs: int) -> tuple[Array, Array, Array, Array, Array]:
    """Arrays for means, covariances, innovations, their covariances and log-likelihoods."""
    k, n, m = rows, states, outputs
    return (
        np.empty((k, n)), np.empty((k, n, n)), np.empty((k, m)), np.empty((k, m, m)), np.empty(k),
    )  # fmt: skip


def named(rows: tuple[Array, Array, Array, Array, Array]) -> dict[str, Array]:
    """The estimates of a filter by their names."""
    means, covariances, innovations, spreads, log_likelihoods = rows
    return {
        "state": means,
        "variance": covariances.diagonal(axis1=1, axis2=2),
        "covariance": covariances,
        "innovation": innovations,
        "innovation_covariance": spreads,
        "log_likelihood": log_likelihoods,
    }


def copies(posterior: Gaussian) -> tuple[Array, Array, Array]:
    """The arrays of an estimate, for a loop to work in."""
    return posterior.mean.copy(), posterior.covariance.copy(), posterior.error.copy()


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


def check_posterior(name: str, posterior: Gaussian, states: int, outputs: int) -> Gaussian:
    """The posterior, of this size: compiled loops would read beyond its end.

    Raises
    ------
    InputError
        If it is of another size, or not finite.
    """
    shapes = [
        getattr(getattr(posterior, part, None), "shape", ())
        for part in ("mean", "covariance", "error")
    ]
    return check_state(
        posterior, Gaussian,
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
        array[row] = as_covariance(f"{name}[{row}]", array[row], size, definite=definite)
    return np.ascontiguousarray(array)
