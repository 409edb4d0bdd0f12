"""What the observers of a rigid body have in common: the record they read, state and result."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import InputError
from reobserve.models.rigid_body import RigidBody
from reobserve.numerics.arguments import as_kind
from reobserve.numerics.matrices import Matrix, as_positive, as_vector
from reobserve.observers import contract
from reobserve.observers.contract import FixedStepObserver, OnDivergence, Samples, check_state

Array = NDArray[np.float64]


class Record(NamedTuple):
    """What an observer reads, arrays of shape (2 n + 1, 3); see `RigidBodyObserver.run`."""

    rate: Matrix
    rate_before: Matrix
    control: Matrix
    control_before: Matrix


class Rows(NamedTuple):
    """What it writes, arrays of shape (n + 1, 3); see `Run`."""

    rate: Matrix
    fault: Matrix
    fault_before: Matrix


@dataclass(frozen=True)
class State:
    """All an observer remembers: a value that may be stored, copied and stepped again.

    ``rate`` is the estimate w^ [rad/s], shape (3,); ``memory`` belongs to the algorithm;
    ``count`` is the number of steps taken.
    """

    rate: Array
    memory: Array
    count: int = 0


@dataclass(frozen=True)
class Estimate:
    """Angular rate [rad/s] and fault torque [N m] at one instant, each of shape (3,)."""

    rate: Array
    fault: Array


@dataclass(frozen=True)
class Run:
    """Estimates at the ends of the steps of a record.

    ``rate`` [rad/s] and ``fault`` [N m] have shape (m, 3), their first row at the start of the
    record; ``fault_before`` holds the limits of ``fault`` from the left, which differ where the
    estimate jumps: at updates, at jumps of the measurement. ``diverged_at`` is None, or the time
    [s] since that start after which the state left the range of floating-point numbers; then m
    counts the rows up to it. ``state`` is the one to go on from, or after a divergence the one
    that the run started from.
    """

    rate: Array
    fault: Array
    fault_before: Array
    state: State
    diverged_at: float | None


@dataclass(frozen=True)
class RigidBodyObserver(FixedStepObserver[State, Run]):
    """An observer that measures w, knows u and estimates the fault torque.

    It integrates with the classical Runge-Kutta method and reads the record at both ends and
    in the middle of each step of ``step_size`` seconds: a record has two samples a step.
    ``model`` is the rigid body as the observer knows it.

    Raises
    ------
    InputError
        If the model is no rigid body or the step not positive.
    """

    model: RigidBody
    step_size: float

    def __post_init__(self) -> None:
        as_kind("model", self.model, RigidBody)
        object.__setattr__(self, "step_size", as_positive("step_size", self.step_size))

    @abstractmethod
    def _fresh_memory(self, fault: Array) -> Array:
        """The memory before the first step, if the estimate was ``fault`` up to then."""

    @abstractmethod
    def _run(self, state: State, record: Record, rows: Rows) -> int:
        """Run the compiled loop on ``state`` in place; return the number of finite rows."""

    def init(self, initial_rate: ArrayLike, initial_fault: ArrayLike = (0.0, 0.0, 0.0)) -> State:
        """The state before the first step.

        Parameters
        ----------
        initial_rate
            Estimate of w [rad/s], shape (3,).
        initial_fault
            Estimate of the fault torque [N m], shape (3,), at all earlier times.

        Raises
        ------
        InputError
            If one of them is not three finite numbers.
        """
        rate = as_vector("initial_rate", initial_rate, 3)
        return State(rate, self._fresh_memory(as_vector("initial_fault", initial_fault, 3)))

    def step(
        self,
        state: State,
        rate: ArrayLike,
        control: ArrayLike,
        rate_before: ArrayLike | None = None,
        control_before: ArrayLike | None = None,
    ) -> tuple[State, Estimate]:
        """One step: the next state, and the estimate at the step's end.

        The arguments are those of `run` for a record of three rows: the start, the middle and
        the end of the step. Stepping through a record gives the bits that `run` gives.

        Raises
        ------
        InputError
            As `run`.
        DivergenceError
            As `run`.
        """
        run = self.run(rate, control, state, rate_before, control_before)
        return run.state, Estimate(run.rate[-1], run.fault[-1])

    def run(
        self,
        rate: ArrayLike,
        control: ArrayLike,
        state: State,
        rate_before: ArrayLike | None = None,
        control_before: ArrayLike | None = None,
        *,
        on_divergence: OnDivergence = "raise",
    ) -> Run:
        """Estimates over a whole record, by one compiled loop.

        Parameters
        ----------
        rate, control
            Measured w [rad/s] and known u [N m], shape (2 n + 1, 3), sampled every half step.
        state
            From `init`, or from an earlier run to go on.
        rate_before, control_before
            Where a record jumps between samples: the limits from the left, same shapes.
        on_divergence
            ``raise``, or ``return`` what there was up to then, with `Run.diverged_at`.

        Raises
        ------
        InputError
            If a shape is wrong, a sample is not finite or the state is not of such an observer.
        DivergenceError
            If an estimate leaves the range of floating-point numbers; it says whether a shorter
            step would have helped.
        """
        state = check_state(
            state, State, "is of an observer of another kind or another delay",
            rate=(3,), memory=self._fresh_memory(np.zeros(3)).shape,
        )  # fmt: skip
        measured = Samples.read("rate", rate, rate_before, 3, like="the measured rate")
        known = Samples.read(
            "control", control, control_before, 3,
            rows=len(measured.right), like="the measured rate",
        )  # fmt: skip
        return self._observe(state, (measured, known), on_divergence)

    def _fill(self, state: State, record: contract.Record) -> contract.Rows:
        measured, known = record
        out = Rows(*(np.empty((measured.steps + 1, 3)) for _ in Rows._fields))
        working = State(state.rate.copy(), state.memory.copy(), state.count)
        samples = Record(measured.right, measured.left, known.right, known.left)
        finite = self._run(working, samples, out)
        out.fault_before[0] = out.fault[0]  # the record has nothing before its first row
        after = State(working.rate, working.memory, state.count + measured.steps)
        return contract.Rows(out, finite, after)

    def _result(self, arrays: tuple[Array, ...], state: State, diverged_at: float | None) -> Run:
        rate, fault, fault_before = arrays
        return Run(rate, fault, fault_before, state, diverged_at)


def whole_steps(interval: float, step: float) -> int:
    """How many steps make the interval; `InputError` if that is no whole number."""
    ratio = interval / step
    count = round(ratio) if np.isfinite(ratio) else 0
    if count < 1 or abs(count * step - interval) > 1e-9 * interval:
        raise InputError(
            "interval", f"{interval:g} s must be a whole multiple of the step of {step:g} s"
        )
    return count
