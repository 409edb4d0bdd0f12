"""Observers of a rigid body: rates [rad/s] and torques [N m] of three axes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from reobserve.core.errors import InputError, located
from reobserve.core.matrices import FloatArray, spectral_radius
from reobserve.estimation.kinds.setup import Estimates, Setup
from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.ilo import ILO
from reobserve.observers.ilo_sampled import SampledILO
from reobserve.observers.rigid_body_observer import RigidBodyObserver
from reobserve.systems.rigid_body import RigidBody

Array = FloatArray


@dataclass(frozen=True)
class Body:
    """Inertia [kg m^2], and how inputs and faults enter."""

    inertia: Array
    input_matrix: Array = field(default_factory=lambda: np.array(1.0))
    fault_matrix: Array = field(default_factory=lambda: np.array(1.0))

    def made(self) -> RigidBody:
        """The model."""
        with located("body"):
            return RigidBody(self.inertia, self.input_matrix, self.fault_matrix)


@dataclass(frozen=True)
class RateStart:
    """What it starts from; without it, from the first measurement and no fault."""

    rate: Array
    fault: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Ilo:
    """An iterative learning observer, in one of its readings."""

    kind: Literal["ilo"]
    body: Body
    K1: Array
    K2: Array
    damping: Array
    reading: Literal["sampled", "continuous", "forgetting"] = "sampled"
    update_interval: float | None = None
    start: RateStart | None = None

    def set_up(self, period: float) -> Setup:
        """The observer, which learns once a sampling period if no interval is given."""
        tau = period if self.update_interval is None else self.update_interval
        made = SampledILO if self.reading == "sampled" else ILO
        observer = made(
            self.body.made(), self.K1, self.K2, self.damping, tau, sampling_period=period
        )
        radius = spectral_radius(observer.K1)
        if self.reading == "forgetting" and radius >= 1.0:
            problem = f"has the spectral radius {radius:g}; to forget, it must be below 1"
            raise InputError("K1", problem)
        return _ready(observer, self.start)


@dataclass(frozen=True)
class Adaptive:
    """An adaptive observer; with a proportional gain, the PI observer of a rigid body."""

    kind: Literal["adaptive", "pi"]
    body: Body
    damping: Array
    integral_gain: Array
    proportional_gain: Array | None = None
    start: RateStart | None = None

    def set_up(self, period: float) -> Setup:
        """The observer."""
        if (self.kind == "pi") != (self.proportional_gain is not None):
            wanted = "is missing; the kind pi needs it" if self.kind == "pi" else (
                "must be left out; the kind pi takes it"
            )  # fmt: skip
            raise InputError("proportional_gain", wanted)
        gain = 0.0 if self.proportional_gain is None else self.proportional_gain
        observer = AdaptiveObserver(
            self.body.made(), self.damping, self.integral_gain, gain, sampling_period=period
        )
        return _ready(observer, self.start)


def _ready(observer: ILO | SampledILO | AdaptiveObserver, start: RateStart | None) -> Setup:
    if start is not None:
        with located("start"):
            observer.init(start.rate, start.fault)

    def begin(y: Array) -> Any:
        return observer.init(y) if start is None else observer.init(start.rate, start.fault)

    return rigid_body_setup(observer, begin)


def rigid_body_setup(observer: RigidBodyObserver, start: Callable[[Array], Any]) -> Setup:
    """The setup of any observer of a rigid body."""
    rank = int(np.linalg.matrix_rank(observer.model.fault_matrix))
    unseen = (
        f"fault: fault_matrix has rank {rank} of 3, so that a part of the fault moves nothing and "
        "its estimate means nothing",
    )
    return Setup(
        observer, start, _residual, ("rad/s",) * 3, ("N m",) * 3,
        {"rate": ("rad/s",) * 3, "fault": ("N m",) * 3}, unseen=unseen if rank < 3 else (),
    )  # fmt: skip


def _residual(y: Array, estimates: Estimates) -> Array:
    residual: Array = y - estimates["rate"]
    return residual
