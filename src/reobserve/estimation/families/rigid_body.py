"""Observers of a rigid body: the body, its signals and the initial state."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray
from reobserve.core.validation import checked
from reobserve.estimation.families.signals import NamedSignal, Signals, listed, numbered
from reobserve.estimation.observer_design import Design, System
from reobserve.observers.rigid_body_observer import RigidBodyObserver, RigidBodyState
from reobserve.systems.rigid_body import RigidBody

Array = FloatArray


def three(place: str, value: Mapping[str, str]) -> None:
    """Three axes."""
    if len(value) not in (0, 3):
        raise InputError(place, f"names {len(value)} signals, must be 3, one an axis")


BODY = "  inertia: [[36.0, 1.5, 0.0], [1.5, 17.0, 0.0], [0.0, 0.0, 26.0]]   # [kg m^2]\n"
ALARMS = """\
  - {name: leak, of: fault_1, beyond: 0.2}                     # [N m], as stated
  - {name: odd, of: residual wx, sigma: 6, since: 1, until: 4} # learned from 1 s to 4 s
"""

Axes = Annotated[Signals, checked(three)]


@dataclass(frozen=True, eq=False, kw_only=True)
class BodySystem(System):
    """J w' = -w x J w + B u + B_f u_f, with w measured."""

    states: Axes = field(default_factory=dict)
    inputs: Axes = field(default_factory=dict)
    inertia: Array
    input_matrix: Array = field(default_factory=lambda: np.eye(3))
    fault_matrix: Array = field(default_factory=lambda: np.eye(3))
    initial_fault: list[float] | None = None

    def __post_init__(self) -> None:
        if self.measurements:
            raise InputError("measurements", "must be left out: they are the states")
        if self.initial_fault is not None and self.initial_state is None:
            raise InputError("initial_fault", "goes with an initial_state")
        for name, signals, unit in (
            ("states", self.states, "rad/s"), ("inputs", self.inputs, "N m"),
        ):  # fmt: skip
            for signal, stated in signals.items():
                if stated != unit:
                    raise InputError(f"{name}.{signal}", f"{stated!r} must be {unit!r}")

    @cached_property
    def body(self) -> RigidBody:
        """The body, or `InputError` if it is none."""
        return RigidBody(self.inertia, self.input_matrix, self.fault_matrix)


@dataclass(frozen=True, eq=False, kw_only=True)
class BodyDesign(Design):
    """An observer of a body's rate and of a fault torque."""

    system: BodySystem

    keys: ClassVar = {"rate": "initial_state", "fault": "initial_fault"}
    predicts: ClassVar[str] = "rate"

    @property
    @abstractmethod
    def observer(self) -> RigidBodyObserver:
        """The observer, ready to run."""

    @property
    def estimates(self) -> Mapping[str, tuple[NamedSignal, ...]]:
        """The rate and the fault torque."""
        faults = tuple(NamedSignal(f"{name}_fault", "N m") for name in self.system.inputs)
        return {"rate": self.states, "fault": faults or numbered("fault", 3, "N m")}

    @property
    def states(self) -> tuple[NamedSignal, ...]:
        """The rates of the body."""
        return listed(self.system.states) or numbered("rate", 3, "rad/s")

    @property
    def measurements(self) -> tuple[NamedSignal, ...]:
        """The rates themselves."""
        return self.states

    @property
    def inputs(self) -> tuple[NamedSignal, ...]:
        """Torques."""
        return listed(self.system.inputs) or numbered("torque", 3, "N m")

    def start(self) -> RigidBodyState | None:
        """The initial rate without a fault, or None for the first measurement."""
        rate, fault = self.system.initial_state, self.system.initial_fault
        if rate is None:
            return None
        return self.observer.init(rate, fault=np.zeros(3) if fault is None else fault)

    @property
    def unseen(self) -> tuple[str, ...]:
        """Sentences that say if a part of the fault has no effect."""
        rank = int(np.linalg.matrix_rank(self.system.body.fault_matrix))
        if rank == 3:
            return ()
        return (
            f"fault: fault_matrix has rank {rank} of 3, so that a part of the fault moves nothing "
            "and its estimate means nothing",
        )
