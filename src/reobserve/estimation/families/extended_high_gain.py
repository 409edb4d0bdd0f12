"""Extended high-gain observer of a state and of the delay of its input."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray, as_vector
from reobserve.estimation.families.high_gain import HighGainDesign
from reobserve.estimation.families.signals import NamedSignal, listed, numbered
from reobserve.estimation.families.triangular import TriangularSystem, step_growth
from reobserve.estimation.observer_design import Certificate, Design, Example
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver, ExtendedHighGainState

_RECORD = """\
# Extended high-gain observer of a state and of the delay of its input.
observer:
  kind: extended-high-gain
  states: {level: "1"}
  drift: {level: -level}     # x1' = x2 + f1(x1), ..., xn' = fn(x) + G(x1) u(t - delay)
  input_gain: 1              # G
  delay_bounds: [0.0, 1.5]   # [s]
  initial_state: [0.0]
  initial_delay: 0.3         # [s]
  gains:
    rho: 5.0                 # [1/s]
    order: 2                 # derivatives of the input, found from its samples
    threshold: 0.035         # of |xi|, below which the delay is unobservable
    switched: delay          # there: only the gain of the delay is zero, or all
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class DelayedSystem(TriangularSystem):
    """A chain whose input comes late, by a delay [s] within bounds."""

    delay_bounds: tuple[float, float]
    initial_delay: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.lipschitz is not None:
            problem = "has no use here: where the delay is estimated, no decay is proved from it"
            raise InputError("lipschitz", problem)
        as_vector("delay_bounds", self.delay_bounds, 2)


@dataclass(frozen=True, eq=False)
class ExtendedGains:
    """rho [1/s], the order of the expansion, the threshold of |xi| and what is off below it."""

    rho: float
    order: int
    threshold: float = 0.0
    switched: Literal["delay", "all"] = "delay"
    initial_matrix: FloatArray | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class ExtendedHighGainDesign(Design):
    """An extended high-gain observer."""

    system: DelayedSystem
    gains: ExtendedGains

    programs: ClassVar = {ExtendedHighGainObserver: "delay_observer:extended_high_gain"}
    differentiates: ClassVar[bool] = True
    predicts: ClassVar[str] = "state"
    holds_inputs: ClassVar[bool] = False
    records: ClassVar = {"extended-high-gain": Example("lag", _RECORD)}

    def __post_init__(self) -> None:
        count, most = len(self.system.inputs), self.gains.order + 1
        if count not in (0, 1, most):
            problem = f"name {count} signals, must name 1, or {most} with the derivatives"
            raise InputError("inputs", problem)

    @cached_property
    def observer(self) -> ExtendedHighGainObserver:
        """The observer."""
        system, gains = self.system, self.gains
        return ExtendedHighGainObserver(
            system.model, rho=gains.rho, order=gains.order, delay_bounds=system.delay_bounds,
            threshold=gains.threshold,
            switched=gains.switched, initial_matrix=gains.initial_matrix,
            sampling_period=system.sampling_period,
        )  # fmt: skip

    @property
    def estimates(self) -> Mapping[str, tuple[NamedSignal, ...]]:
        """State, delay, and the share of each period in which gains were off."""
        return {
            "state": self.states,
            "delay": (NamedSignal("delay", "s"),),
            "switched_off": (NamedSignal("switched_off", "1"),),
        }

    def start(self) -> ExtendedHighGainState:
        """The initial state and delay."""
        return self.observer.init(self.system.start, delay=self.system.initial_delay)

    @property
    def inputs(self) -> tuple[NamedSignal, ...]:
        """The input, alone or with its derivatives."""
        return listed(self.system.inputs) or numbered("input", 1)

    measurements = HighGainDesign.measurements

    @property
    def widths(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """The numbers of columns, with derivatives where the input is not named."""
        return super().widths if self.system.inputs else ((1,), (1, self.gains.order + 1))

    def certify(self) -> Certificate:
        """Poles of the linear part, and what a step leaves of its errors."""
        rho, step = self.observer.rho, self.observer.sampling_period
        poles = [[-rho, 0.0] for _ in range(len(self.states) + 1)]
        return {"poles": poles, "step_growth": step_growth(rho, step)}

    def summary(self) -> list[str]:
        """Poles, and what is not certified."""
        n = len(self.states) + 1
        least, most = self.system.delay_bounds
        return [
            f"extended high-gain observer, expansion of order {self.gains.order}",
            f"poles: {n} at {-self.gains.rho:.6g} 1/s, of the linear part of the error",
            f"the estimate of the delay stays from {least:g} to {most:g} s; that it converges is "
            "not certified: this asks for an input that moves enough (|xi| above the threshold) "
            "and a rest of the expansion that is small, which no gain can promise",
        ]
