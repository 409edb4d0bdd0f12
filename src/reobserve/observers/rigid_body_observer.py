"""What the observers of a rigid body have in common: the record they read, state and result."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.errors import DivergenceError, InputError
from reobserve.matrices import Matrix, as_record, as_vector
from reobserve.rigid_body import RigidBody

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
class RigidBodyObserver(ABC):
    """An observer that measures w, knows u and estimates the fault torque.

    It integrates with the classical Runge-Kutta method and reads the record at both ends and
    in the middle of each step of ``step_size`` seconds: a record has two samples a step.
    ``model`` is the rigid body as the observer knows it.
    """

    model: RigidBody
    step_size: float

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
            If the state leaves the range of floating-point numbers in this step.
        """
        run = self.run(rate, control, state, rate_before, control_before)
        if run.diverged_at is not None:
            raise DivergenceError(type(self).__name__, state.count * self.step_size)
        return run.state, Estimate(run.rate[-1], run.fault[-1])

    def run(
        self,
        rate: ArrayLike,
        control: ArrayLike,
        state: State,
        rate_before: ArrayLike | None = None,
        control_before: ArrayLike | None = None,
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

        Raises
        ------
        InputError
            If a shape is wrong, a sample is not finite or the state is not of such an observer.
        """
        if state.memory.shape != self._fresh_memory(np.zeros(3)).shape:
            raise InputError("state", "is of an observer of another kind or another delay")
        right = as_record("rate", rate, 3)
        rows = len(right)
        known = as_record("control", control, 3, rows)
        record = Record(
            right,
            right if rate_before is None else as_record("rate_before", rate_before, 3, rows),
            known,
            known
            if control_before is None
            else as_record("control_before", control_before, 3, rows),
        )
        steps = rows // 2
        out = Rows(*(np.empty((steps + 1, 3)) for _ in Rows._fields))
        working = State(state.rate.copy(), state.memory.copy(), state.count)
        finite = self._run(working, record, out)
        out.fault_before[0] = out.fault[0]  # the record has nothing before its first row
        # The loop watches the rate; a fault estimate may overflow one row earlier.
        if finite > 1 and not np.isfinite([values[finite - 1] for values in out]).all():
            finite -= 1
        if finite == steps + 1:
            return Run(*out, State(working.rate, working.memory, state.count + steps), None)
        kept = Rows(*(values[:finite] for values in out))
        return Run(*kept, state, (finite - 1) * self.step_size)


def whole_steps(interval: float, step: float) -> int:
    """How many steps make the interval; `InputError` if that is no whole number."""
    ratio = interval / step
    count = round(ratio) if np.isfinite(ratio) else 0
    if count < 1 or abs(count * step - interval) > 1e-9 * interval:
        raise InputError(
            "interval", f"{interval:g} s must be a whole multiple of the step of {step:g} s"
        )
    return count
