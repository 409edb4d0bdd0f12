"""What the estimators of an input delay have in common: plant, record, state and result.

    x' = -a x + b u(t - tau(t)),    x known

is the plant of the comparison in Lechappe et al. 2018 ((39) with a = b = 1). The paper cites the
estimators that it compares with and prints none of them, and we had none of the cited papers. The
modules that build on this one are therefore reconstructions: each says what equations it has and
how one comes to them, and what holds for it need not hold for the method that the paper ran.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import InputError
from reobserve.numerics.arguments import as_kind
from reobserve.numerics.matrices import as_positive, as_scalar, as_vector
from reobserve.observers.contract import (
    FixedStepObserver,
    OnDivergence,
    Record,
    Rows,
    Samples,
    check_state,
)
from reobserve.timeseries.input_history import InputHistory, samples_with_limits

Array = NDArray[np.float64]

# The classical Runge-Kutta method is stable for x' = -r x up to r h = 2.785.
STABLE_STEP = 2.78


@dataclass(frozen=True)
class State:
    """All an estimator remembers: a value that may be stored, copied and stepped again.

    ``values`` belong to the algorithm, the estimate of the delay [s] first; ``history`` is the
    input as far back as the greatest delay; ``count`` steps were taken.
    """

    values: Array
    history: InputHistory
    count: int = 0


@dataclass(frozen=True)
class Run:
    """Estimates at the ends of the steps of a record.

    ``delay`` [s], shape (m,), and all ``values`` of the algorithm, shape (m, n), their first row
    at the start of the record. ``diverged_at`` is None, or the time [s] since that start after
    which the values left the range of floating-point numbers; then m counts the rows up to it.
    ``state`` is the one to go on from, or after a divergence the one that the run started from.
    """

    delay: Array
    values: Array
    state: State
    diverged_at: float | None


@dataclass(frozen=True)
class DelayEstimator(FixedStepObserver[State, Run]):
    """An estimator of the delay of x' = -a x + b u(t - tau).

    Parameters
    ----------
    decay
        a [1/s].
    input_gain
        b [1/s] if x and u have the same unit, not zero.
    delay_bounds
        [s], the least and the greatest delay, 0 <= tau_min < tau_max; the estimate stays in
        between.
    step_size
        [s]; a record has two samples a step.

    Raises
    ------
    InputError
        If a parameter is not as said.
    """

    decay: float
    input_gain: float
    delay_bounds: tuple[float, float]
    step_size: float

    output_columns: ClassVar[int] = 1

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "decay", as_scalar("decay", self.decay))
        put(self, "input_gain", as_scalar("input_gain", self.input_gain))
        if self.input_gain == 0:
            raise InputError("input_gain", "0 must not be zero: the output would not see the input")
        least, greatest = as_vector("delay_bounds", self.delay_bounds, 2).tolist()
        if not 0 <= least < greatest:
            raise InputError(
                "delay_bounds", f"{least:g} and {greatest:g} s must be 0 <= tau_min < tau_max"
            )
        put(self, "delay_bounds", (least, greatest))
        put(self, "step_size", as_positive("step_size", self.step_size))

    @abstractmethod
    def _start(self, delay: float, output: float) -> Array:
        """The values before the first step."""

    @abstractmethod
    def _run(self, output: Array, history: InputHistory, rows: Array) -> int:
        """Fill ``rows`` from its first one; return how many are finite.

        ``history`` goes on to the end of the record.
        """

    @property
    def history_steps(self) -> int:
        """How many steps of the past input a state keeps: those of the greatest delay."""
        return int(np.ceil(self.delay_bounds[1] / self.step_size * (1 - 1e-12)))

    def init(
        self,
        initial_delay: float,
        initial_output: float,
        past_input: ArrayLike,
        past_input_before: ArrayLike | None = None,
    ) -> State:
        """The state before the first step.

        Parameters
        ----------
        initial_delay
            Estimate of the delay [s], inside the bounds.
        initial_output
            x at the start.
        past_input
            u and u' [1/s] at both ends and in the middle of the steps up to the start, shape
            (2 k + 1, 2), from tau_max before the start or earlier. Its last row is the start,
            as it is seen from before.
        past_input_before
            If the input jumped before the start: the limits from the left, same shape.

        Raises
        ------
        InputError
            If the initial delay is outside the bounds, the past too short, a shape wrong or a
            number not finite.
        """
        delay, (least, greatest) = as_scalar("initial_delay", initial_delay), self.delay_bounds
        if not least <= delay <= greatest:
            raise InputError(
                "initial_delay", f"{delay:g} s must be from {least:g} to {greatest:g} s"
            )
        right, left = samples_with_limits("past_input", past_input, past_input_before)
        if len(right) // 2 < self.history_steps:
            raise InputError(
                "past_input",
                f"goes back {len(right) // 2 * self.step_size:g} s, must go back the greatest "
                f"delay of {greatest:g} s or more",
            )
        history = InputHistory(self.step_size, right, left).latest(self.history_steps)
        # The last row is the limit from the left; the control of the first step has the other one.
        return State(self._start(delay, as_scalar("initial_output", initial_output)), history)

    def step(
        self,
        state: State,
        output: ArrayLike,
        control: ArrayLike,
        control_before: ArrayLike | None = None,
    ) -> tuple[State, float]:
        """One step: the next state, and the estimate of the delay [s] at the step's end.

        The arguments are those of `run` for a record of three rows: the start, the middle and
        the end of the step. Stepping through a record gives the bits that `run` gives.

        Raises
        ------
        InputError
            As `run`.
        DivergenceError
            As `run`.
        """
        run = self.run(output, control, state, control_before)
        return run.state, float(run.delay[-1])

    def run(
        self,
        output: ArrayLike,
        control: ArrayLike,
        state: State,
        control_before: ArrayLike | None = None,
        *,
        on_divergence: OnDivergence = "raise",
    ) -> Run:
        """Estimates over a whole record, by one compiled loop.

        Parameters
        ----------
        output
            x, shape (2 m + 1, 1), sampled every half step; an estimator that needs the
            derivative too says so, then shape (2 m + 1, 2).
        control
            u and u' [1/s], shape (2 m + 1, 2).
        state
            From `init`, or from an earlier run to go on.
        control_before
            Where the input jumps between steps: the limits from the left, same shape.
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `Run.diverged_at`.

        Raises
        ------
        InputError
            If a shape is wrong, a sample is not finite or the state is of another estimator.
        DivergenceError
            If an estimate leaves the range of floating-point numbers.
        """
        size = len(self._start(self.delay_bounds[1], 0.0))
        problem = "is of an estimator of another kind, step or greatest delay"
        state = check_state(state, State, problem, values=(size,))
        history = as_kind("state.history", state.history, InputHistory)
        if history.steps != self.history_steps or history.step_size != self.step_size:
            raise InputError("state", problem)
        measured = Samples.read("output", output, None, self.output_columns)
        right, left = samples_with_limits("control", control, control_before)
        if len(right) != len(measured.right):
            raise InputError(
                "control", f"has {len(right)} rows, must have {len(measured.right)} like output"
            )
        return self._observe(state, (measured, Samples(right, left)), on_divergence)

    def _fill(self, state: State, record: Record) -> Rows:
        measured, control = record
        rows = np.empty((measured.steps + 1, len(state.values)))
        rows[0] = state.values
        known = state.history.followed_by(control.right, control.left)
        finite = self._run(measured.right, known, rows)
        kept = known.latest(self.history_steps)
        return Rows((rows,), finite, State(rows[-1].copy(), kept, state.count + measured.steps))

    def _result(self, arrays: tuple[Array, ...], state: State, diverged_at: float | None) -> Run:
        (rows,) = arrays
        return Run(rows[:, 0].copy(), rows, state, diverged_at)

    def _halved(self, state: State) -> None:
        """None: steps that are too long are refused beforehand, see `check_rate`."""


def check_rate(name: str, rate: float, step: float) -> None:
    """Refuse a rate [1/s] of the estimator's own that the Runge-Kutta method cannot follow.

    Raises
    ------
    InputError
        If the step is above the method's limit of stability.
    """
    if rate * step > STABLE_STEP:
        raise InputError(
            name,
            f"makes a rate of {rate:g} 1/s, which with steps of {step:g} s is unstable; "
            f"rate times step must be {STABLE_STEP:g} or less",
        )
