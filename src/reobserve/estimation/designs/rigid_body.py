"""What designs of observers of a rigid body share: the body, its signals, and how they start."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray, as_vector
from reobserve.core.validation import checked
from reobserve.estimation.designs.design import Design
from reobserve.estimation.designs.linear_system import Period
from reobserve.estimation.designs.signals import Signal, Signals
from reobserve.observers.rigid_body_observer import RigidBodyObserver, State
from reobserve.systems.rigid_body import RigidBody

Array = FloatArray


def three(place: str, value: Mapping[str, str]) -> None:
    """Three axes."""
    if len(value) != 3:
        raise InputError(place, f"names {len(value)} signals, must be 3, one an axis")


Axes = Annotated[Signals, checked(three)]


@dataclass(frozen=True, eq=False, kw_only=True)
class BodySystem:
    """J w' = -w x J w + B u + B_f u_f, with w measured."""

    sampling_period: Period
    states: Axes = field(default_factory=lambda: {f"rate_{a}": "rad/s" for a in "xyz"})
    inputs: Axes = field(default_factory=lambda: {f"torque_{a}": "N m" for a in "xyz"})
    inertia: Array
    input_matrix: Array = field(default_factory=lambda: np.eye(3))
    fault_matrix: Array = field(default_factory=lambda: np.eye(3))
    initial_state: list[float] | None = None

    def __post_init__(self) -> None:
        if self.initial_state is not None:
            as_vector("initial_state", self.initial_state, 3)
        for name, signals, unit in (
            ("states", self.states, "rad/s"), ("inputs", self.inputs, "N m"),
        ):  # fmt: skip
            for signal, stated in signals.items():
                if stated != unit:
                    raise InputError(f"{name}.{signal}", f"{stated!r} must be {unit!r}")

    @property
    def measurements(self) -> dict[str, str]:
        """The rates themselves."""
        return self.states

    @cached_property
    def body(self) -> RigidBody:
        """The body; `InputError` if it is none."""
        return RigidBody(self.inertia, self.input_matrix, self.fault_matrix)


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyDesign(Design):
    """An observer of a body's rate and of a fault torque."""

    system: BodySystem

    @property
    @abstractmethod
    def observer(self) -> RigidBodyObserver:
        """The observer, ready to run."""

    @property
    def estimates(self) -> Mapping[str, tuple[Signal, ...]]:
        """The rate and the fault torque."""
        faults = tuple(Signal(f"{signal.name}_fault", "N m") for signal in self.inputs)
        return {"rate": self.states, "fault": faults}

    def start(self) -> State | None:
        """The initial rate without a fault; None for the first measurement."""
        stated = self.system.initial_state
        return None if stated is None else self.observer.init(stated)
