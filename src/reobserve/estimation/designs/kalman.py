"""Design of a Kalman filter: with the gain that it comes to, or with a covariance in time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Literal, Self

import numpy as np

from reobserve.core.documents import Tree
from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray
from reobserve.core.validation import parse
from reobserve.estimation.designs.design import Certificate, Design, pairs, told
from reobserve.estimation.designs.linear_system import LinearSystem
from reobserve.estimation.designs.signals import Signal, variances
from reobserve.observers.fixed_gain import FixedGainObserver
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.linear_filter import LinearFilter, State
from reobserve.synthesis.linear import steady_kalman_gain

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
Q: [1.0e-10, 1.0e-8]        # variances of the noise that a sample adds to the states
R: 1.0e-6                   # of the noise of a measurement
initial_state: [0.3, 0]
initial_variance: [0.01, 0.01]
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class NoisySystem(LinearSystem):
    """A linear system of which the noise is known."""

    Q: Array
    R: Array


@dataclass(frozen=True, eq=False)
class KalmanGains:
    """``gain`` is K at rest, shape (n, m); without it, it follows the covariance in time."""

    law: Literal["steady", "varying"]
    gain: Array | None = None

    def __post_init__(self) -> None:
        if (self.gain is None) != (self.law == "varying"):
            wanted = "must be left out" if self.law == "varying" else "is missing"
            raise InputError("gain", f"{wanted} if the law is {self.law}")


@dataclass(frozen=True, eq=False, kw_only=True)
class KalmanDesign(Design):
    """A Kalman filter, with steady gain or not."""

    system: NoisySystem
    gains: KalmanGains
    certificate: Certificate = field(default_factory=dict)

    example: ClassVar[str] = EXAMPLE

    @classmethod
    def designed(cls, model: Tree, *, varying: bool = False) -> Self:
        """The filter of a model's file; raises as `of`, and for wrong keys."""
        return cls.of(parse(NoisySystem, model), steady=not varying)

    @classmethod
    def of(cls, system: NoisySystem, *, steady: bool = True) -> Self:
        """The Kalman filter of a system.

        Raises
        ------
        InputError
            If it comes to no gain, `reobserve.synthesis.linear.steady_kalman_gain`.
        """
        gain = steady_kalman_gain(system.model)
        gains = KalmanGains("steady", gain) if steady else KalmanGains("varying")
        return cls(system=system, gains=gains)

    @cached_property
    def observer(self) -> LinearFilter:
        """The filter."""
        if self.gains.gain is None:
            return KalmanFilter(self.system.model)
        return FixedGainObserver(self.system.model, self.gains.gain)

    @property
    def estimates(self) -> Mapping[str, tuple[Signal, ...]]:
        """Those of `LinearFilter`."""
        return filter_estimates(self)

    def start(self) -> State:
        """Initial mean and covariance, at the first sample."""
        return self.observer.init(self.system.mean, self.system.initial_variance)

    def certify(self) -> Certificate:
        """Poles of the error at rest, the gain against the Riccati equation's.

        Raises
        ------
        InputError
            If there is no gain at rest, or the gain is another.
        """
        steady, given = steady_kalman_gain(self.system.model), self.gains.gain
        if given is not None:
            resting = FixedGainObserver(self.system.model, given)  # refuses other shapes
            off = float(np.max(np.abs(resting.gain - steady)))
            if off > 1e-6 * float(np.max(np.abs(steady))):
                worst = np.unravel_index(np.argmax(np.abs(resting.gain - steady)), steady.shape)
                raise InputError(
                    f"gain[{worst[0]}][{worst[1]}]",
                    f"is {resting.gain[worst]:.9g}, the Riccati equation gives {steady[worst]:.9g}",
                )
        resting = FixedGainObserver(self.system.model, steady if given is None else given)
        return {"poles": pairs(resting.poles), "spectral_radius": float(np.abs(resting.poles[0]))}

    def summary(self) -> list[str]:
        """Poles, and how fast errors decay."""
        kept = "steady gain" if self.gains.gain is not None else "gain that follows the covariance"
        return [f"Kalman filter, {kept}", *decay_told(self)]


def filter_estimates(design: Design) -> Mapping[str, tuple[Signal, ...]]:
    """Names and units of what a linear filter estimates."""
    return {
        "state": design.states,
        "variance": variances(design.states),
        "innovation": tuple(Signal(f"{s.name}_innovation", s.unit) for s in design.measurements),
        "log_likelihood": (Signal("log_likelihood", "1"),),
    }


def decay_told(design: Design) -> list[str]:
    """What poles of discrete time mean."""
    radius, period = design.certificate["spectral_radius"], design.system.sampling_period
    if radius == 0:
        return ["poles: all zero; an error is gone after as many samples as there are states"]
    rate = -period / np.log(radius)
    return [
        f"poles: {told(design.certificate['poles'])}, of the error from sample to sample",
        f"spectral radius {radius:.6g}: the slowest error falls to 37 % in {rate:.3g} s",
    ]
