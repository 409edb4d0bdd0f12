"""Extended state observers, which estimate actuator and sensor faults with the state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from reobserve.core.errors import located
from reobserve.core.matrices import FloatArray
from reobserve.estimation.kinds.setup import Estimates, Setup
from reobserve.observers.extended_state import ExtendedStateObserver
from reobserve.synthesis.extended_state.system import AugmentedSystem, Gains

Array = FloatArray


@dataclass(frozen=True)
class System:
    """The plant of an extended state observer, `AugmentedSystem`."""

    A: Array
    B: Array
    C: Array
    Dd: Array
    Dw: Array
    Fa: Array
    Fs: Array
    Az: Array | None = None


@dataclass(frozen=True)
class EsoGains:
    """L and Ld; without Ld it is the PI observer."""

    L: Array
    Ld: Array | None = None


@dataclass(frozen=True)
class EsoStart:
    """Of [x, xz, fa, fs] and of the filter; zeros if left out."""

    estimate: Array | None = None
    filtered: Array | None = None


@dataclass(frozen=True)
class Eso:
    """A PI or PD/PI extended state observer."""

    kind: Literal["eso"]
    system: System
    gains: EsoGains
    start: EsoStart | None = None

    def set_up(self, period: float) -> Setup:
        """The observer."""
        parts = {name: part for name, part in vars(self.system).items() if part is not None}
        with located("system"):
            system = AugmentedSystem(**parts)
        Ld = np.zeros((system.size, system.outputs)) if self.gains.Ld is None else self.gains.Ld
        with located("gains"):
            observer = ExtendedStateObserver(
                system, Gains(self.gains.L, Ld), sampling_period=period
            )
        start = self.start or EsoStart()
        with located("start"):
            observer.init(start.estimate, start.filtered)
        return Setup(
            observer,
            lambda y: observer.init(start.estimate, start.filtered),
            eso_residual(system),
        )


def eso_residual(system: AugmentedSystem) -> Callable[[Array, Estimates], Array]:
    """What of y neither the state nor the sensor fault explains."""

    def residual(y: Array, estimates: Estimates) -> Array:
        found: Array = y.copy()  # column by column: the same bits for a row and for many
        for matrix, values in (
            (system.C, estimates["state"]),
            (system.Fs, estimates["sensor_fault"]),
        ):
            for column in range(matrix.shape[1]):
                found -= values[:, column, None] * matrix[:, column]
        return found

    return residual
