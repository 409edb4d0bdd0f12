"""Design of a Luenberger observer, by the poles of its error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from reobserve.core.arguments import as_poles
from reobserve.core.documents import Tree
from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray
from reobserve.core.validation import checked, parse
from reobserve.estimation.designs.design import Certificate, Design, pairs
from reobserve.estimation.designs.kalman import decay_told, filter_estimates
from reobserve.estimation.designs.linear_system import LinearSystem
from reobserve.estimation.designs.poles import as_pole_list, check_poles, parse_poles
from reobserve.estimation.designs.signals import Signal
from reobserve.observers.fixed_gain import FixedGainObserver, luenberger
from reobserve.observers.linear_filter import State

Array = FloatArray

EXAMPLE = """\
# A pendulum whose angle is measured.
time: continuous            # or discrete: A and B are then those of a sample
sampling_period: 0.01       # [s]
states: {angle: rad, rate: rad/s}
inputs: {torque: N m}       # held from sample to sample
measurements: {angle: rad}
A: [[0, 1], [-0.983, -0.1]]
B: [[0], [1]]
H: [[1, 0]]
poles: [-3, -4]             # [1/s], of discrete time those of a sample; complex: "-3+1j"
initial_state: [0.3, 0]
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class PlacedSystem(LinearSystem):
    """A linear system, and the poles that errors are to have."""

    poles: Annotated[list[Any], checked(check_poles)] | None = None


@dataclass(frozen=True, eq=False)
class LuenbergerGains:
    """``gain`` is L, shape (n, m)."""

    gain: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class LuenbergerDesign(Design):
    """An observer of constant gain."""

    system: PlacedSystem
    gains: LuenbergerGains
    certificate: Certificate = field(default_factory=dict)

    example: ClassVar[str] = EXAMPLE

    @classmethod
    def designed(cls, model: Tree, *, poles: str | None = None) -> Self:
        """The observer of a model's file; raises as `of`, and for wrong keys."""
        system = parse(PlacedSystem, model)
        return cls.of(system, None if poles is None else parse_poles(poles))

    @classmethod
    def of(cls, system: PlacedSystem, poles: Sequence[complex] | None = None) -> Self:
        """The observer whose error has these poles: [1/s] of continuous time, else of a sample.

        Left out, they are those that the system states.

        Raises
        ------
        InputError
            If the poles cannot be placed, `reobserve.synthesis.linear.place`, are not stable, or
            are nowhere.
        """
        if poles is None and system.poles is None:
            raise InputError("poles", "are missing; the model or the command line states them")
        chosen = as_pole_list("poles", system.poles or []) if poles is None else list(poles)
        placed = as_poles("poles", chosen)
        if system.time == "continuous":
            with np.errstate(over="ignore"):
                placed = np.exp(placed * system.sampling_period)
        gain = luenberger(system.model, placed).gain
        return cls(system=system, gains=LuenbergerGains(gain))

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
