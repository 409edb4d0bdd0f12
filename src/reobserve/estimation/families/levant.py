"""Robust exact differentiator, by a bound on the highest derivative."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray
from reobserve.estimation.families.signals import NamedSignal, numbered, product
from reobserve.estimation.observer_design import Certificate, Design, Example, System
from reobserve.observers.levant import LevantDifferentiator

Array = FloatArray

_RECORD = """\
# Robust exact differentiator of one signal.
# Estimates: derivatives_1 is the signal without its noise [V], derivatives_2 its rate [V/s], and
# derivatives_3 the rate of that; with `measurements: {voltage: V}` they are named after it.
observer:
  kind: levant
  gains:
    L: 1.5                   # bound on the derivative of order 3 [V/s^3]
    order: 2
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class SignalSystem(System):
    """One signal."""

    def __post_init__(self) -> None:
        if len(self.measurements) > 1:
            problem = f"name {len(self.measurements)} signals, must be the one to differentiate"
            raise InputError("measurements", problem)
        for name in ("states", "inputs"):
            if getattr(self, name):
                raise InputError(name, "must be left out: there are none")


@dataclass(frozen=True, eq=False)
class LevantGains:
    """``L`` bounds the derivative of order ``order`` + 1. ``lambdas`` as the observer has them."""

    L: float
    order: int = 2
    lambdas: list[float] | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class LevantDesign(Design):
    """A robust exact differentiator."""

    system: SignalSystem
    gains: LevantGains

    programs: ClassVar = {LevantDifferentiator: "integrating:differentiator"}
    keys: ClassVar = {"derivatives": "initial_state"}
    predicts: ClassVar[str] = "derivatives"
    records: ClassVar = {"levant": Example("signal", _RECORD)}

    @cached_property
    def observer(self) -> LevantDifferentiator:
        """The differentiator."""
        gains = self.gains
        return LevantDifferentiator(
            L=gains.L,
            order=gains.order,
            lambdas=gains.lambdas,
            sampling_period=self.system.sampling_period,
        )

    @property
    def states(self) -> tuple[NamedSignal, ...]:
        """The signal and its derivatives."""
        if not self.system.measurements:
            return numbered("derivatives", self.gains.order + 1)
        ((name, unit),) = self.system.measurements.items()
        units = [product(unit, f"1/s^{i}" if i else "1") for i in range(self.gains.order + 1)]
        return tuple(
            NamedSignal(f"{name}_derivative_{i}" if i else name, unit)
            for i, unit in enumerate(units)
        )

    @property
    def estimates(self) -> Mapping[str, tuple[NamedSignal, ...]]:
        """The signal and its derivatives."""
        return {"derivatives": self.states}

    def certify(self) -> Certificate:
        """The error that some steps leave for a signal within the bound: L T^(n+1-i) of each."""
        powers = self.gains.order + 1 - np.arange(self.gains.order + 1)
        with np.errstate(over="ignore"):  # what is not finite is refused
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
