"""High-gain observer, from right-hand sides as text: one number is chosen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

from reobserve.core.errors import InputError
from reobserve.estimation.families.signals import NamedSignal, listed
from reobserve.estimation.families.triangular import TriangularSystem, decay_sentence, step_growth
from reobserve.estimation.observer_design import Certificate, Design, Example
from reobserve.observers.high_gain import HighGainObserver, HighGainState

_RECORD = """\
# High-gain observer of x1' = x2 + f1(x1), ..., xn' = fn(x) + G(x1) u with y = x1.
observer:
  kind: high-gain
  states: {angle: rad, rate: rad/s}
  inputs: {torque: N m}      # as it reaches the plant
  drift: {angle: 0, rate: -9.81*sin(angle) - 0.5*rate}
  input_gain: 4              # G
  # lipschitz: {rate: {angle: 9.81, rate: 0.5}}   # of df_i/dx_j, to prove a decay, from rho = 12 on
  gains: {rho: 8.0}          # [1/s], all poles of its linear part
"""


@dataclass(frozen=True, eq=False)
class HighGain:
    """rho [1/s]."""

    rho: float


@dataclass(frozen=True, eq=False, kw_only=True)
class HighGainDesign(Design):
    """A standard high-gain observer."""

    system: TriangularSystem
    gains: HighGain

    programs: ClassVar = {HighGainObserver: "integrating:standard_high_gain"}
    predicts: ClassVar[str] = "state"
    records: ClassVar = {"high-gain": Example("driven_pendulum", _RECORD)}

    def __post_init__(self) -> None:
        if len(self.system.inputs) > 1:
            problem = f"name {len(self.system.inputs)} signals, must name one"
            raise InputError("inputs", problem)

    @cached_property
    def observer(self) -> HighGainObserver:
        """The observer."""
        system = self.system
        return HighGainObserver(
            system.model, rho=self.gains.rho, sampling_period=system.sampling_period
        )

    def start(self) -> HighGainState:
        """The initial state."""
        return self.observer.init(self.system.start)

    @property
    def measurements(self) -> tuple[NamedSignal, ...]:
        """The first state."""
        return listed(self.system.measurements) or self.states[:1]

    def certify(self) -> Certificate:
        """Poles of the linear part, what a step leaves of its errors, and the decay proved."""
        rho, step = self.observer.rho, self.observer.sampling_period
        certificate: Certificate = {
            "poles": [[-rho, 0.0] for _ in self.states], "step_growth": step_growth(rho, step),
        }  # fmt: skip
        decay = self.system.decay(rho)
        if decay is None:
            return certificate
        if not decay > 0:
            raise InputError(
                "rho",
                f"{rho:g} 1/s is too low for the bounds of lipschitz: errors are proved to grow by "
                f"no more than {-decay:.4g} 1/s, not to decay",
            )
        return {**certificate, "decay": decay}

    def summary(self) -> list[str]:
        """Poles, and what is proved."""
        n = len(self.states)
        return [
            "high-gain observer",
            f"poles: {n} at {-self.gains.rho:.6g} 1/s, of the linear part of the error",
            decay_sentence(self.certificate),
        ]
