"""Design of an interacting multiple model: the modes that a plant may be in, and their chain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal

import numpy as np

from reobserve.core.errors import InputError, located
from reobserve.core.matrices import FloatArray
from reobserve.estimation.designs.design import Certificate, Design
from reobserve.estimation.designs.kalman import NoisySystem
from reobserve.estimation.designs.signals import Signal, check_signals, covariances, variances
from reobserve.observers.imm import IMM, State
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.linear_filter import LinearFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter

Array = FloatArray

EXAMPLE = """\
# A pendulum that may be worn: its friction tells which.
time: continuous            # or discrete: A and B are then those of a sample
sampling_period: 0.01       # [s]
states: {angle: rad, rate: rad/s}
inputs: {torque: N m}       # held from sample to sample
measurements: {angle: rad}
modes:                      # each says where it is not like the rest of this file
  sound: {}
  worn: {A: [[0, 1], [-0.983, -0.5]]}
A: [[0, 1], [-0.983, -0.1]]
B: [[0], [1]]
H: [[1, 0]]
Q: [1.0e-10, 1.0e-8]        # variances of the noise that a sample adds to the states
R: 1.0e-6                   # of the noise of a measurement
initial_state: [0.3, 0]
initial_variance: [0.01, 0.01]
gains:
  filter: kalman            # or svsf, with boundary_layer and memory
  transition: [[0.999, 0.001], [0.001, 0.999]]      # from one sample to the next
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class Mode:
    """Where a mode differs."""

    A: Array | None = None
    B: Array | None = None
    H: Array | None = None
    D: Array | None = None
    Q: Array | None = None
    R: Array | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class ManyModes(NoisySystem):
    """A linear system in several modes."""

    modes: dict[str, Mode]

    def __post_init__(self) -> None:
        super().__post_init__()
        check_signals("modes", dict.fromkeys(self.modes, "1"))
        if not 1 <= len(self.modes) <= 50:
            raise InputError("modes", f"are {len(self.modes)}, must be 1 to 50")

    def models(self) -> list[Any]:
        """A sampled model for each mode; `InputError` names the mode that has none."""
        own = {each: getattr(self, each) for each in _SHARED}
        found = []
        for name, mode in self.modes.items():
            changed = {k: v for k in "ABHDQR" if (v := getattr(mode, k)) is not None}
            with located(f"modes.{name}"):
                found.append(NoisySystem(**{**own, **changed}).model)
        return found


_SHARED = (
    *("time", "sampling_period", "states", "inputs", "measurements"),
    *("A", "B", "H", "D", "Q", "R"),
)


@dataclass(frozen=True, eq=False, kw_only=True)
class BankGains:
    """The filter of all modes, the chain's probabilities, and whether beliefs are mixed."""

    filter: Literal["kalman", "svsf"]
    transition: Array
    mixing: bool = True
    boundary_layer: Array | None = None
    memory: float | None = None
    inverse: Literal["pseudo", "weighted"] = "pseudo"

    def __post_init__(self) -> None:
        for name in ("boundary_layer", "memory"):
            if (getattr(self, name) is None) != (self.filter == "kalman"):
                wanted = "must be left out" if self.filter == "kalman" else "is missing"
                raise InputError(name, f"{wanted} with the filter {self.filter}")


@dataclass(frozen=True, eq=False, kw_only=True)
class ImmDesign(Design):
    """An interacting multiple model."""

    system: ManyModes
    gains: BankGains
    certificate: Certificate = field(default_factory=dict)

    example: ClassVar[str] = EXAMPLE

    @cached_property
    def observer(self) -> IMM:
        """The bank."""
        gains = self.gains
        filters: list[LinearFilter] = []
        for model in self.system.models():
            if gains.boundary_layer is None or gains.memory is None:
                filters.append(KalmanFilter(model))
            else:
                layer, memory = gains.boundary_layer, gains.memory
                one = SmoothVariableStructureFilter(model, layer, memory, gains.inverse)
                filters.append(one)
        return IMM(filters, gains.transition, gains.mixing)

    @property
    def estimates(self) -> Mapping[str, tuple[Signal, ...]]:
        """Mixture, probabilities of modes, innovations of all filters."""
        modes = tuple(self.system.modes)
        return {
            "state": self.states,
            "variance": variances(self.states),
            "covariance": covariances(self.states),
            "probability": tuple(Signal(f"{mode}_probability", "1") for mode in modes),
            "innovation": tuple(
                Signal(f"{mode}_{signal.name}_innovation", signal.unit)
                for mode in modes
                for signal in self.measurements
            ),
            "log_likelihood": (Signal("log_likelihood", "1"),),
        }

    def start(self) -> State:
        """Initial mean and covariance of all modes, at the first sample."""
        return self.observer.init(self.system.mean, self.system.initial_variance)

    def certify(self) -> Certificate:
        """How long the chain stays in each mode on average, in samples."""
        chain = self.observer.transition
        stay = [min(float(1.0 / max(1.0 - p, 1e-300)), 1e300) for p in np.diag(chain)]
        return {f"samples_in_{mode}": s for mode, s in zip(self.system.modes, stay, strict=True)}

    def summary(self) -> list[str]:
        """How long the chain stays in each mode."""
        period = self.system.sampling_period
        lines = [f"interacting multiple model of {len(self.system.modes)} modes"]
        for mode in self.system.modes:
            seconds = self.certificate[f"samples_in_{mode}"] * period
            lines.append(f"{mode}: stays for {seconds:.4g} s on average")
        return lines
