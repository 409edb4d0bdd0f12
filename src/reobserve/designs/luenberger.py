"""Design of a Luenberger observer, by the poles of its error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from reobserve.designs.design import Certificate, Design, pairs
from reobserve.designs.kalman import decay_told, filter_estimates
from reobserve.designs.linear_system import LinearSystem
from reobserve.designs.signals import Signal
from reobserve.numerics.arguments import as_poles
from reobserve.observers.fixed_gain import FixedGainObserver, luenberger
from reobserve.observers.linear_filter import State

Array = NDArray[np.float64]

EXAMPLE = """\
# A pendulum whose angle is measured. The poles are told on the command line: --poles "-3, -4"
time: continuous            # or discrete: A and B are then those of a sample
sampling_period: 0.01       # [s]
states: {angle: rad, rate: rad/s}
inputs: {torque: N m}       # held from sample to sample
measurements: {angle: rad}
A: [[0, 1], [-0.983, -0.1]]
B: [[0], [1]]
H: [[1, 0]]
initial_state: [0.3, 0]
"""


@dataclass(frozen=True, eq=False)
class LuenbergerGains:
    """``gain`` is L, shape (n, m)."""

    gain: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class LuenbergerDesign(Design):
    """An observer of constant gain."""

    system: LinearSystem
    gains: LuenbergerGains
    certificate: Certificate = field(default_factory=dict)

    @cached_property
    def observer(self) -> FixedGainObserver:
        """The observer."""
        return FixedGainObserver(self.system.model, self.gains.gain)

    @property
    def estimates(self) -> Mapping[str, tuple[Signal, ...]]:
        """Those of `LinearFilter`."""
        return filter_estimates(self)

    def start(self) -> State:
        """The initial state, at the first sample."""
        return self.observer.init(self.system.mean, self.system.initial_variance)

    def certify(self) -> Certificate:
        """Poles of the error."""
        poles = self.observer.poles
        return {"poles": pairs(poles), "spectral_radius": float(np.abs(poles[0]))}

    def summary(self) -> list[str]:
        """Poles, and how fast errors decay."""
        return ["Luenberger observer", *decay_told(self)]


def design_luenberger(system: LinearSystem, poles: Sequence[complex]) -> LuenbergerDesign:
    """The observer whose error has these poles: [1/s] of continuous time, else of a sample.

    Raises
    ------
    InputError
        If the poles cannot be placed, `reobserve.synthesis.linear.place`, or are not stable.
    """
    placed = as_poles("poles", list(poles))
    if system.time == "continuous":
        placed = np.exp(placed * system.sampling_period)
    gain = luenberger(system.model, placed).gain
    return LuenbergerDesign(system=system, gains=LuenbergerGains(gain))
