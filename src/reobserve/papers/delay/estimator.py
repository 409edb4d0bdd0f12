"""What the estimators of an input delay have in common: what they read, remember and estimate.

    x' = -a x + b u(t - tau(t)),    x known

is the plant of a comparison, with a = b = 1 (Lechappe et al. 2018, (39)). The paper cites the
estimators that it compares with and prints none of them, and we had none of the cited papers. The
modules that build on this one are therefore reconstructions: each says what equations it has and
how one comes to them, and what holds for it need not hold for the method that the paper ran.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import as_kind
from reobserve.core.errors import InputError
from reobserve.core.matrices import as_sample_rows, as_scalar, as_vector
from reobserve.core.value import Value, converter
from reobserve.observers.contract import Observer, Record, Rows, check_state
from reobserve.observers.fixed_step import Samples, Steps, steps_between
from reobserve.observers.row_derivatives import rows_before
from reobserve.papers.delay.input_history import InputHistory

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class State(Value):
    """All an estimator remembers: a value that may be stored, copied and stepped again.

    ``values`` belong to the algorithm, the estimate of the delay [s] first; ``history`` is the
    input as far back as the greatest delay; the rest is as in
    `reobserve.observers.contract.ObserverState`.
    """

    values: Array
    history: InputHistory
    sample: Array | None = None
    count: int = 0


@dataclass(frozen=True, eq=False, repr=False)
class DelayEstimator(Observer[State]):
    """An estimator of the delay of x' = -a x + b u(t - tau).

    It measures x and knows u and u' [1/s], rows of two numbers. An estimator that needs x' [1/s]
    too says so, and takes rows of x and x'. In between x goes in straight lines and u along the
    cubic through u and u' at both ends: a u that is held says nothing of a delay.

    Its estimates are ``delay`` [s], shape (k,), and ``values``, shape (k, n), all numbers of the
    algorithm in the order that each estimator gives.

    Parameters
    ----------
    decay
        a [1/s].
    input_gain
        b [1/s] if x and u have the same unit, not zero.
    delay_bounds
        [s], the least and the greatest delay, 0 <= tau_min < tau_max; the estimate stays in
        between.
    sampling_period
        [s], and the step of the method.

    Raises
    ------
    InputError
        If a parameter is not as said.
    """

    decay: float = field(metadata=converter(as_scalar))
    input_gain: float = field(metadata=converter(as_scalar))
    delay_bounds: tuple[float, float]

    measurements: ClassVar[int] = 1
    inputs: ClassVar[int] = 2
    units: ClassVar[Mapping[str, str]] = {"delay": "s", "values": ""}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.input_gain == 0:
            raise InputError("input_gain", "0 must not be zero: the output would not see the input")
        least, greatest = as_vector("delay_bounds", self.delay_bounds, 2).tolist()
        if not 0 <= least < greatest:
            raise InputError(
                "delay_bounds", f"{least:g} and {greatest:g} s must be 0 <= tau_min < tau_max"
            )
        self._set("delay_bounds", (least, greatest))

    @abstractmethod
    def _values(self, x: float, delay: float) -> Array:
        """The values before the first step."""

    @abstractmethod
    def _run(self, output: Samples, history: InputHistory, rows: Array) -> int:
        """Fill ``rows`` from its first one; return how many are finite.

        ``history`` goes on to the end of the record.
        """

    @property
    def history_steps(self) -> int:
        """How many periods of the past input a state keeps: those of the greatest delay."""
        return int(np.ceil(self.delay_bounds[1] / self.sampling_period * (1 - 1e-12)))

    def init(
        self,
        state: float,
        delay: float,
        past_u: ArrayLike,
        *,
        before: ArrayLike | None = None,
        middle: ArrayLike | None = None,
    ) -> State:
        """The state at the first sample.

        Parameters
        ----------
        state
            x there.
        delay
            Estimate of the delay [s], inside the bounds.
        past_u
            The input up to the first sample, rows like those of u, shape (k, 2): the first tau_max
            before it or earlier, the last at it, as it is seen from before.
        before
            If the past jumps at samples: its limits from the left, in the shape of ``past_u``.
        middle
            The input half a period before each row, likewise. The first row of both has no use.

        Raises
        ------
        InputError
            If the delay is outside the bounds, the past too short, a shape wrong or a number not
            finite.
        """
        tau, (least, greatest) = as_scalar("delay", delay), self.delay_bounds
        if not least <= tau <= greatest:
            raise InputError("delay", f"{tau:g} s must be from {least:g} to {greatest:g} s")
        values = self._values(as_scalar("state", state), tau)
        return State(values, self._history(past_u, before, middle))

    def _history(
        self, past_u: ArrayLike, before: ArrayLike | None, middle: ArrayLike | None
    ) -> InputHistory:
        past = as_sample_rows("past_u", past_u, self.inputs)
        if len(past) <= self.history_steps:
            raise InputError(
                "past_u",
                f"goes back {(len(past) - 1) * self.sampling_period:g} s, must go back the "
                f"greatest delay of {self.delay_bounds[1]:g} s or more",
            )
        between: list[Array | None] = []
        for name, given in (("before", before), ("middle", middle)):
            rows = None if given is None else as_sample_rows(name, given, self.inputs)
            if rows is not None and len(rows) != len(past):
                raise InputError(name, f"has {len(rows)} rows, must have {len(past)} like past_u")
            between.append(rows)
        left, inside = self._smooth(past, between[0], between[1], None)
        samples = steps_between(None, Record(past, past, (left, left), (inside, inside))).u
        history = InputHistory(samples.right, samples.left, sampling_period=self.sampling_period)
        # The last row is the limit from the left; the first row of a record has the other one.
        return history.latest(self.history_steps)

    def _smooth(
        self, u: Array, before: Array | None, middle: Array | None, last: Array | None
    ) -> tuple[Array, Array]:
        """Limits of u and u' from the left, and values in the middle, by default of a cubic."""
        period, end = self.sampling_period, u if before is None else before
        if middle is None:
            start = rows_before(u, last)
            value = 0.5 * (start[:, 0] + end[:, 0]) + 0.125 * period * (start[:, 1] - end[:, 1])
            rate = 1.5 / period * (end[:, 0] - start[:, 0]) - 0.25 * (start[:, 1] + end[:, 1])
            middle = np.column_stack([value, rate])
        return end, middle

    def _checked(self, state: Any) -> State:
        problem = "is of an estimator of another kind, sampling period or greatest delay"
        size = len(self._values(0.0, self.delay_bounds[1]))
        checked = check_state(
            state, State, problem,
            values=(size,), sample=(self.measurements + self.inputs,),
        )  # fmt: skip
        history = as_kind("state.history", checked.history, InputHistory)
        if history.steps != self.history_steps or history.sampling_period != self.sampling_period:
            raise InputError("state", problem)
        return checked

    def _completed(self, state: State, record: Record) -> tuple[State, Record]:
        """State and record with an input that is not held."""
        last = None if state.sample is None else state.sample[self.measurements :]
        before, middle = self._smooth(record.u, record.before[1], record.middle[1], last)
        y_before, y_middle = record.before[0], record.middle[0]
        return state, record._replace(before=(y_before, before), middle=(y_middle, middle))

    def _integrate(self, state: State, steps: Steps) -> Rows:
        y, u = steps
        rows = np.empty((y.steps + 1, len(state.values)))
        rows[0] = state.values
        known, finite = state.history, 1
        if y.steps:
            known = known.followed_by(u.right, u.left)
            finite = self._run(y, known, rows)
        after = replace(
            state, values=rows[-1].copy(), history=known.latest(self.history_steps),
            count=state.count + y.steps,
        )  # fmt: skip
        return Rows({"delay": rows[:, 0].copy(), "values": rows}, finite, after)

    def _halved(self, state: State) -> tuple[DelayEstimator, State]:
        finer = replace(self, sampling_period=0.5 * self.sampling_period)
        history = state.history.halved().latest(finer.history_steps)
        return finer, replace(state, history=history, count=2 * state.count)
