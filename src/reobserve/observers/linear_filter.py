"""What Kalman filters and their kin share: a linear prediction, corrected by a gain.

A filter holds a `LinearModel` and a law for its gain. Its memory is a value, a `Belief`; `step`
takes it with one sample and returns the next one, `run` takes a whole record through one compiled
loop over the same arithmetic, so that both give the same bits.

A row of measurements with a nan in it is a sample that was not taken: the filter predicts over it,
and the run counts it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import DivergenceError, InputError
from reobserve.models.linear import LinearModel, as_covariance
from reobserve.numerics.arguments import as_kind
from reobserve.numerics.matrices import as_row, as_samples, as_vector
from reobserve.observers.contract import OnDivergence, check_state, raises
from reobserve.observers.linear_filter_loop import (
    correct,
    is_missing,
    new_work,
    predict,
    run_filter,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Belief:
    """What a filter holds to be true: a value that may be stored, copied and stepped again.

    ``mean``, shape (n,), and ``covariance``, (n, n), of the state; ``error`` is the filter's own a
    posteriori output error e(k|k) of (18), shape (m,), which the SVSF needs a sample later.
    """

    mean: Array
    covariance: Array
    error: Array


@dataclass(frozen=True, eq=False)
class Correction:
    """A belief after a measurement, and how well that was foretold.

    ``innovation`` e(k+1|k), shape (m,), its ``innovation_covariance`` S, shape (m, m), and the
    ``log_likelihood`` of the measurement. For a missing one they are nan, nan and zero.
    """

    belief: Belief
    innovation: Array
    innovation_covariance: Array
    log_likelihood: float


class ModeFilter(Protocol):
    """What an interacting multiple model asks of a filter, one of ours or a user's own."""

    @property
    def model(self) -> Any:
        """What has ``states``, ``inputs`` and ``outputs``: their numbers."""

    def predict(self, belief: Belief, control: Array) -> Belief:
        """The belief a sample later, before its measurement."""

    def correct(self, belief: Belief, measurement: Array, control: Array) -> Correction:
        """The predicted belief after the measurement; a nan in that means there is none."""


@dataclass(frozen=True, eq=False)
class FilterRun:
    """What a filter makes of a record, one row a sample.

    ``estimate`` and ``variance``, shape (k, n), are mean and diagonal of the covariance after each
    measurement, ``innovation``, (k, m), and ``log_likelihood``, (k,), what it told. ``missing``
    counts the samples that were not taken. ``diverged_at`` is None, or the first row that is not
    finite; then k counts the rows before it. ``belief`` is the one to go on from, or after a
    divergence the one that the run started from.
    """

    estimate: Array
    variance: Array
    innovation: Array
    log_likelihood: Array
    missing: int
    belief: Belief
    diverged_at: int | None


@dataclass(frozen=True, eq=False)
class LinearFilter:
    """A filter on a linear model; what derives from it says what its gain is.

    Parameters
    ----------
    model
        The linear model that it trusts.

    Raises
    ------
    InputError
        If it is no linear model.
    """

    model: LinearModel

    def __post_init__(self) -> None:
        as_kind("model", self.model, LinearModel)

    @property
    def law(self) -> Any:
        """The law of the gain, made by `gain_law`."""
        raise NotImplementedError

    @property
    def law_parameters(self) -> Array:
        """What the law gets as its parameters."""
        return np.empty(0)

    @cached_property
    def _sizes(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        return (0,) * self.model.states, (0,) * self.model.outputs

    def init(self, mean: ArrayLike, covariance: ArrayLike) -> Belief:
        """The belief before the first sample.

        Parameters
        ----------
        mean
            Of the state, shape (n,).
        covariance
            Of the state: a number, n numbers or (n, n); positive semidefinite.

        Raises
        ------
        InputError
            If one of them is not that.
        """
        return Belief(
            as_vector("mean", mean, self.model.states),
            as_covariance("covariance", covariance, self.model.states),
            np.zeros(self.model.outputs),
        )

    def predict(self, belief: Belief, control: ArrayLike = ()) -> Belief:
        """Time update, (11) and (12), with the input that is held over the step, shape (p,).

        Raises
        ------
        InputError
            If the control or the belief has another size.
        DivergenceError
            If the belief leaves the range of floating-point numbers.
        """
        states, outputs = self._sizes
        belief = check_belief("belief", belief, len(states), len(outputs))
        mean, covariance = np.empty_like(belief.mean), np.empty_like(belief.covariance)
        held = as_vector("control", control, self.model.inputs)
        predict(
            states, self.model.arrays, held, belief.mean, belief.covariance,
            mean, covariance, new_work(len(states), len(outputs)),
        )  # fmt: skip
        if not np.isfinite(mean.sum() + np.trace(covariance)):
            raise DivergenceError(type(self).__name__, 0, sample=True)
        return Belief(mean, covariance, belief.error)

    def correct(
        self, belief: Belief, measurement: ArrayLike, control: ArrayLike = ()
    ) -> Correction:
        """Measurement update, (13) to (19), of a predicted belief.

        Raises
        ------
        InputError
            If the measurement (nan: missing), the control or the belief has another size.
        DivergenceError
            If the covariance of the innovation is not positive definite, or the belief leaves the
            range of floating-point numbers.
        """
        row = as_row("measurements", measurement)
        taken = as_samples("measurements", row, self.model.outputs, missing=True)[0]
        held = as_vector("control", control, self.model.inputs)
        states, outputs = self._sizes
        m = len(outputs)
        belief = check_belief("belief", belief, len(states), m)
        innovation, factor = np.full(m, np.nan), np.full((m, m), np.nan)
        if is_missing(taken):
            return Correction(belief, innovation, factor, 0.0)
        mean, covariance, error = (
            belief.mean.copy(), belief.covariance.copy(), belief.error.copy()
        )  # fmt: skip
        log_likelihood = correct(
            states, outputs, self.model.arrays, self.law, self.law_parameters, taken, held,
            mean, covariance, error, innovation, factor, new_work(len(states), m),
        )  # fmt: skip
        if not np.isfinite(log_likelihood + mean.sum() + np.trace(covariance)):
            raise DivergenceError(type(self).__name__, 0, sample=True)
        corrected = Belief(mean, covariance, error)
        return Correction(corrected, innovation, factor @ factor.T, log_likelihood)

    def step(self, belief: Belief, measurement: ArrayLike, control: ArrayLike = ()) -> Correction:
        """Predict over one sample and correct; stepping gives the bits that `run` gives.

        Raises
        ------
        InputError
            As `run`.
        DivergenceError
            As `run`; the sample is number 0.
        """
        return self.correct(self.predict(belief, control), measurement, control)

    def run(
        self,
        measurements: ArrayLike,
        belief: Belief,
        controls: ArrayLike | None = None,
        *,
        on_divergence: OnDivergence = "raise",
    ) -> FilterRun:
        """Filter a record by one compiled loop.

        Parameters
        ----------
        measurements
            At the end of each step, shape (k, m); a row with a nan is a missing one.
        belief
            From `init`, or from an earlier run to go on.
        controls
            Held over each step, shape (k, p); left out for a model without inputs.
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `FilterRun.diverged_at`.

        Raises
        ------
        InputError
            If the shapes do not fit, or a control is not finite.
        DivergenceError
            If the belief leaves the range of floating-point numbers; it gives the sample.
        """
        loud = raises(on_divergence)
        states, outputs = self._sizes
        n, m = len(states), len(outputs)
        belief = check_belief("belief", belief, n, m)
        taken = as_samples("measurements", measurements, m, missing=True)
        held = as_controls(controls, len(taken), self.model.inputs)
        rows = len(taken)
        mean, covariance, error = (
            belief.mean.copy(), belief.covariance.copy(), belief.error.copy()
        )  # fmt: skip
        found = FilterRun(
            np.empty((rows, n)), np.empty((rows, n)), np.empty((rows, m)), np.empty(rows),
            int(np.isnan(taken).any(axis=1).sum()), Belief(mean, covariance, error), None,
        )  # fmt: skip
        good = run_filter(
            states, outputs, self.model.arrays, self.law, self.law_parameters, taken, held,
            mean, covariance, error, np.empty((m, m)), new_work(n, m),
            found.estimate, found.variance, found.innovation, found.log_likelihood,
        )  # fmt: skip
        if good == rows:
            return found
        if loud:
            raise DivergenceError(type(self).__name__, good, sample=True)
        return FilterRun(
            found.estimate[:good], found.variance[:good], found.innovation[:good],
            found.log_likelihood[:good], int(np.isnan(taken[:good]).any(axis=1).sum()),
            belief, good,
        )  # fmt: skip


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


def as_controls(value: ArrayLike | None, rows: int, columns: int) -> Array:
    """Controls as ``rows`` rows of ``columns`` finite numbers; None for no columns.

    Raises
    ------
    InputError
        If they are not, with the first row that is not finite.
    """
    if value is None and not columns:
        return np.empty((rows, 0))
    if value is None:
        raise InputError("controls", f"are left out, must have shape {(rows, columns)}")
    return as_samples("controls", value, columns, rows=rows, like="the measurements")
