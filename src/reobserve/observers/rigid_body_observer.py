"""Base class of the observers of a rigid body: their inputs, state and estimates."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reobserve.core.arguments import MOST_STEPS, as_kind
from reobserve.core.errors import InputError
from reobserve.core.matrices import Matrix, as_vector
from reobserve.core.value import Value, converter
from reobserve.observers.contract import IntegratingObserver
from reobserve.observers.fixed_step import Steps
from reobserve.observers.record import Rows, check_state
from reobserve.systems.rigid_body import RigidBody

Array = NDArray[np.float64]


class RigidBodyRecord(NamedTuple):
    """Inputs of a loop, arrays of shape (2 n + 1, 3): w and u with their limits from the left."""

    rate: Matrix
    rate_before: Matrix
    control: Matrix
    control_before: Matrix


class RigidBodyRows(NamedTuple):
    """Outputs of a loop, arrays of shape (n + 1, 3)."""

    rate: Matrix
    fault: Matrix
    fault_before: Matrix


@dataclass(frozen=True, eq=False, repr=False)
class RigidBodyState(Value):
    """All an observer remembers: a value that may be stored, copied and stepped again.

    ``rate`` is the estimate w^ [rad/s], shape (3,); ``memory`` belongs to the algorithm; the rest
    is as in `reobserve.observers.record.ObserverState`.
    """

    rate: Array
    memory: Array
    sample: Array | None = None
    count: int = 0
    time: float | None = None


@dataclass(frozen=True, eq=False, repr=False)
class RigidBodyObserver(IntegratingObserver[RigidBodyState]):
    """An observer that measures w [rad/s], knows u [N m] and estimates the fault torque.

    Its estimates are ``rate`` [rad/s] and ``fault`` [N m], shape (k, 3). `Run.before` has the
    limits of ``fault`` from the left, which differ where it jumps: at updates, and where the
    measurement jumps.

    Parameters
    ----------
    model
        The observer's model of the rigid body.
    sampling_period
        [s], and the step of the classical Runge-Kutta method.

    Raises
    ------
    InputError
        If the model is no rigid body or the period not positive.
    """

    model: RigidBody = field(metadata=converter(as_kind, RigidBody))

    measurements: ClassVar[int] = 3
    inputs: ClassVar[int] = 3
    units: ClassVar[Mapping[str, str]] = {"rate": "rad/s", "fault": "N m"}

    @property
    def _memory_shape(self) -> tuple[int, ...]:
        """The shape of `RigidBodyState.memory`, whose last axis is that of the fault."""
        return (3,)

    @abstractmethod
    def _run(
        self, rate: Array, memory: Array, count: int, record: RigidBodyRecord, rows: RigidBodyRows
    ) -> int:
        """Run the compiled loop, and return the number of finite rows.

        ``rate`` and ``memory`` are those of the state, ``count`` steps after the first of all; the
        loop leaves the new ones in place.
        """

    def init(self, rate: ArrayLike, *, fault: ArrayLike = (0.0, 0.0, 0.0)) -> RigidBodyState:
        """The state at the first sample. Without it a run starts from the first measurement.

        Parameters
        ----------
        rate
            Estimate of w [rad/s], shape (3,).
        fault
            Estimate of the fault torque [N m], shape (3,), at all earlier times.

        Raises
        ------
        InputError
            If one of them is not three finite numbers.
        """
        memory = np.broadcast_to(as_vector("fault", fault, 3), self._memory_shape)
        return RigidBodyState(as_vector("rate", rate, 3), memory.copy())

    def _start(self, first: Array) -> RigidBodyState:
        return self.init(first)

    def _checked(self, state: Any) -> RigidBodyState:
        return check_state(
            state, RigidBodyState, "is of an observer of another kind or another delay",
            rate=(3,), memory=self._memory_shape, sample=(6,),
        )  # fmt: skip

    def _integrate(self, state: RigidBodyState, steps: Steps) -> Rows:
        y, u = steps
        out = RigidBodyRows(*np.empty((3, y.steps + 1, 3)))
        rate, memory = state.rate.copy(), state.memory.copy()
        record = RigidBodyRecord(y.right, y.left, u.right, u.left)
        finite = self._run(rate, memory, state.count, record, out)
        out.fault_before[0] = out.fault[0]  # the record has nothing before its first row
        after = RigidBodyState(rate, memory, state.sample, state.count + y.steps)
        estimates = {"rate": out.rate, "fault": out.fault}
        return Rows(estimates, finite, after, {"fault": out.fault_before})


def whole_steps(interval: float, step: float) -> int:
    """The number of steps that make the interval, or `InputError` if that is no whole number."""
    ratio = interval / step
    count = round(ratio) if np.isfinite(ratio) else 0
    if count < 1 or abs(count * step - interval) > 1e-9 * interval:
        raise InputError(
            "update_interval",
            f"{interval:g} s must be a whole multiple of the sampling period of {step:g} s",
        )
    if count > MOST_STEPS:
        problem = (
            f"{interval:g} s has {count:.3g} sampling periods, must have {MOST_STEPS} or fewer"
        )
        raise InputError("update_interval", problem)
    return count
