"""Design of a robust exact differentiator, by a bound on the highest derivative."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_vector
from reobserve.estimation.designs.design import Certificate, Design
from reobserve.estimation.designs.linear_system import Period
from reobserve.estimation.designs.signals import Signal, Signals, product
from reobserve.observers.levant import LevantDifferentiator, State

EXAMPLE = """\
# The angle of an encoder, of which rate and acceleration are wanted.
sampling_period: 0.001      # [s]
measurements: {angle: rad}
gains:
  order: 2                  # the highest derivative
  L: 50                     # [rad/s^3] at most of the derivative after it
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class SignalSystem:
    """One signal."""

    sampling_period: Period
    measurements: Signals
    initial_state: list[float] | None = None

    def __post_init__(self) -> None:
        if len(self.measurements) != 1:
            problem = f"name {len(self.measurements)} signals, must be the one to differentiate"
            raise InputError("measurements", problem)

    inputs: ClassVar[Mapping[str, str]] = {}
    states: ClassVar[Mapping[str, str]] = {}


@dataclass(frozen=True, eq=False)
class LevantGains:
    """``L`` bounds the derivative of order ``order`` + 1; ``lambdas`` as the observer has them."""

    order: int
    L: float
    lambdas: list[float] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class LevantDesign(Design):
    """A robust exact differentiator."""

    system: SignalSystem
    gains: LevantGains
    certificate: Certificate = field(default_factory=dict)

    example: ClassVar[str] = EXAMPLE

    @cached_property
    def observer(self) -> LevantDifferentiator:
        """The differentiator."""
        gains = self.gains
        return LevantDifferentiator(
            gains.L, gains.order, gains.lambdas, sampling_period=self.system.sampling_period
        )

    @property
    def states(self) -> tuple[Signal, ...]:
        """The signal and its derivatives."""
        ((name, unit),) = self.system.measurements.items()
        units = [product(unit, f"1/s^{i}" if i else "1") for i in range(self.gains.order + 1)]
        return tuple(
            Signal(f"{name}_derivative_{i}" if i else name, unit) for i, unit in enumerate(units)
        )

    @property
    def estimates(self) -> Mapping[str, tuple[Signal, ...]]:
        """The signal and its derivatives."""
        return {"derivatives": self.states}

    def start(self) -> State | None:
        """The initial derivatives; None for the first measurement."""
        stated = self.system.initial_state
        if stated is None:
            return None
        return self.observer.init(as_vector("initial_state", stated, self.gains.order + 1))

    def certify(self) -> Certificate:
        """What of a signal within the bound is left after some steps: L T^(n+1-i) of each."""
        powers = self.gains.order + 1 - np.arange(self.gains.order + 1)
        scales = self.observer.L * self.observer.sampling_period**powers
        return {f"scale_{i}": float(scale) for i, scale in enumerate(scales)}

    def summary(self) -> list[str]:
        """Accuracy without noise."""
        lines = [f"robust exact differentiator of order {self.gains.order}"]
        for i, signal in enumerate(self.states):
            scale = self.certificate[f"scale_{i}"]
            lines.append(
                f"{signal.name}: error of the order of {scale:.3g} {signal.unit}, no noise"
            )
        return lines
