"""Design of a smooth variable structure filter: its boundary layers and its memory are chosen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Literal

from reobserve.core.matrices import FloatArray
from reobserve.estimation.designs.design import Certificate, Design
from reobserve.estimation.designs.kalman import NoisySystem, filter_estimates
from reobserve.estimation.designs.signals import Signal
from reobserve.observers.linear_filter import State
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter

Array = FloatArray

EXAMPLE = """\
# A pendulum whose angle and rate are measured.
time: continuous            # or discrete: A and B are then those of a sample
sampling_period: 0.01       # [s]
states: {angle: rad, rate: rad/s}
inputs: {torque: N m}       # held from sample to sample
measurements: {angle: rad, rate: rad/s}
A: [[0, 1], [-0.983, -0.1]]
B: [[0], [1]]
H: [[1, 0], [0, 1]]
Q: [1.0e-8, 1.0e-6]         # variances of the noise that a sample adds to the states
R: [1.0e-6, 1.0e-4]         # of the noise of a measurement
initial_state: [0.3, 0]
initial_variance: [0.01, 0.01]
gains:
  boundary_layer: [0.02, 0.1]   # innovations within it are taken in part
  memory: 0.1                   # from 0 to below 1: how fast errors outside it shrink
  inverse: pseudo               # of H; or weighted, by the covariance
"""


@dataclass(frozen=True, eq=False)
class SwitchingGains:
    """psi in units of the measurements, gamma, and which inverse of H."""

    boundary_layer: Array
    memory: float
    inverse: Literal["pseudo", "weighted"] = "pseudo"


@dataclass(frozen=True, eq=False, kw_only=True)
class SvsfDesign(Design):
    """A smooth variable structure filter."""

    system: NoisySystem
    gains: SwitchingGains
    certificate: Certificate = field(default_factory=dict)

    example: ClassVar[str] = EXAMPLE

    @cached_property
    def observer(self) -> SmoothVariableStructureFilter:
        """The filter."""
        gains = self.gains
        return SmoothVariableStructureFilter(
            self.system.model, gains.boundary_layer, gains.memory, gains.inverse
        )

    @property
    def estimates(self) -> Mapping[str, tuple[Signal, ...]]:
        """Those of `LinearFilter`."""
        return filter_estimates(self)

    def start(self) -> State:
        """Initial mean and covariance, at the first sample."""
        return self.observer.init(self.system.mean, self.system.initial_variance)

    def certify(self) -> Certificate:
        """How output errors outside the layers shrink, if H is square; the observer's checks."""
        outputs, states = self.observer.model.arrays.C.shape
        return {"contraction": self.observer.memory, "square": outputs == states}

    def summary(self) -> list[str]:
        """What holds outside the boundary layers."""
        known = self.certificate
        lines = ["smooth variable structure filter"]
        if known["square"]:
            lines.append(
                f"outside the layers output errors shrink to {known['contraction']:g} a sample"
            )
        else:
            lines.append("fewer outputs than states: what the outputs do not see is not certified")
        return lines
