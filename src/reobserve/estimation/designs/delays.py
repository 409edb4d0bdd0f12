"""Designs of estimators of an input delay: gains are chosen, what they promise is computed."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_scalar, as_vector
from reobserve.estimation.designs.design import Certificate, Design, pairs, told
from reobserve.estimation.designs.linear_system import Period
from reobserve.estimation.designs.signals import Signal, Signals, product
from reobserve.observers.delay_adaptive import AdaptiveDelayEstimator
from reobserve.observers.delay_estimator import DelayEstimator, State
from reobserve.observers.delay_least_squares import LeastSquaresDelayEstimator
from reobserve.observers.delay_variable_structure import VariableStructureDelayEstimator

_MOST_PERIODS = 20_000  # of past input

_EXAMPLE = """\
# A valve behind a pipe of unknown length: x' = -decay x + input_gain u(t - delay), x measured.
sampling_period: 0.01       # [s]
inputs: {{valve: "1"}}        # u alone, or u and then u', as {{valve: "1", valve_rate: 1/s}}
measurements: {{level: "1"}}  # x{also}
decay: 1                    # [1/s]
input_gain: 1               # [1/s] if x and u have one unit
delay_bounds: [0, 1.5]      # [s]
initial_delay: 0.3          # [s]
past_input: 0               # where u stood before; x then starts at rest, or at initial_state
gains:
{gains}"""


@dataclass(frozen=True, eq=False, kw_only=True)
class DelaySystem:
    """x' = -decay x + input_gain u(t - delay), and what there was before the first row."""

    sampling_period: Period
    inputs: Signals
    measurements: Signals
    decay: float
    input_gain: float
    delay_bounds: tuple[float, float]
    initial_delay: float
    past_input: float = 0.0
    initial_state: float | None = None

    states: ClassVar[Mapping[str, str]] = {}

    def __post_init__(self) -> None:
        greatest = as_vector("delay_bounds", self.delay_bounds, 2)[1]
        if not greatest <= _MOST_PERIODS * self.sampling_period:
            raise InputError(
                "delay_bounds",
                f"reach to {greatest:g} s, must be {_MOST_PERIODS} sampling periods or less: so "
                "long is the past input that is kept",
            )
        for name in ("decay", "input_gain", "initial_delay", "past_input"):
            as_scalar(name, getattr(self, name))
        if self.initial_state is not None:
            as_scalar("initial_state", self.initial_state)

    @property
    def start(self) -> float:
        """x at the first row: as stated, or at rest."""
        if self.initial_state is not None:
            return self.initial_state
        if self.decay == 0 and self.past_input != 0:
            raise InputError("initial_state", "is missing: without a decay nothing is at rest")
        return self.input_gain * self.past_input / self.decay if self.past_input else 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class DelayDesign(Design):
    """What the three have in common."""

    system: DelaySystem
    certificate: Certificate = field(default_factory=dict)

    measured: ClassVar[tuple[int, ...]] = (1,)  # how many columns y may have

    def __post_init__(self) -> None:
        allowed = {"measurements": self.measured, "inputs": (1, 2)}
        for name, counts in allowed.items():
            named = len(getattr(self.system, name))
            if named not in counts:
                known = " or ".join(map(str, counts))
                problem = f"name {named} signals, must name {known}: the second is the derivative"
                raise InputError(name, problem if len(counts) > 1 else problem.partition(":")[0])

    @property
    @abstractmethod
    def observer(self) -> DelayEstimator:
        """The estimator."""

    @property
    @abstractmethod
    def values(self) -> tuple[Signal, ...]:
        """The numbers of the algorithm after the delay."""

    @property
    def unit(self) -> str:
        """That of x."""
        return next(iter(self.system.measurements.values()))

    @property
    def estimates(self) -> Mapping[str, tuple[Signal, ...]]:
        """The delay, and all numbers of the algorithm."""
        return {
            "delay": (Signal("delay", "s"),),
            "values": (Signal("estimated_delay", "s"), *self.values),
        }

    def start(self) -> State:
        """At rest, or as stated."""
        past = np.full(self.observer.history_steps + 1, self.system.past_input)
        return self.observer.init(self.system.start, self.system.initial_delay, past)


@dataclass(frozen=True, eq=False)
class LeastSquaresGains:
    """P(0) [s per squared x] and f [1/s]."""

    initial_covariance: float
    forgetting: float


@dataclass(frozen=True, eq=False, kw_only=True)
class LeastSquaresDelayDesign(DelayDesign):
    """By recursive least squares of the output error."""

    gains: LeastSquaresGains

    example: ClassVar[str] = _EXAMPLE.format(
        also="",
        gains="""\
  initial_covariance: 100   # [s per squared x]: how little the first delay is trusted
  forgetting: 0.25          # [1/s]; a quarter of decay is the fastest
""",
    )

    @cached_property
    def observer(self) -> LeastSquaresDelayEstimator:
        """The estimator."""
        system, gains = self.system, self.gains
        return LeastSquaresDelayEstimator(
            system.decay, system.input_gain, system.delay_bounds,
            gains.initial_covariance, gains.forgetting, sampling_period=system.sampling_period,
        )  # fmt: skip

    @property
    def values(self) -> tuple[Signal, ...]:
        """x_m, phi and R."""
        unit = self.unit
        return (
            Signal("model", unit), Signal("sensitivity", product(unit, "1/s")),
            Signal("information", product(unit, unit, "1/s")),
        )  # fmt: skip

    def certify(self) -> Certificate:
        """Poles of the error for an input that is a ramp, once R is steady."""
        a, f = self.observer.decay, self.observer.forgetting
        root = np.sqrt(complex(1.0 - 4.0 * f / a))  # of s^2 + a s + a f = 0, over a
        if not np.isfinite(root):
            raise InputError("forgetting", f"{f:g} 1/s over a decay of {a:g} 1/s is beyond numbers")
        poles = np.array([-0.5 * a * (1.0 - root), -0.5 * a * (1.0 + root)])
        return {"poles": pairs(poles[np.lexsort((poles.imag, -poles.real))])}

    def summary(self) -> list[str]:
        """Poles, and where they hold."""
        lines = [
            "delay by recursive least squares, a reconstruction",
            f"poles: {told(self.certificate['poles'])} 1/s, of the error for an input that is a "
            "ramp; for others, and from far off, convergence is not certified",
        ]
        if not self.gains.forgetting:
            lines.append("without forgetting it moves less and less: the pole at 0 does not decay")
        return lines


@dataclass(frozen=True, eq=False)
class AdaptiveDelayGains:
    """k [s], l [1/s] and Gamma [s^2 per squared x]."""

    filter_time: float
    forgetting: float
    adaptation_gain: float


@dataclass(frozen=True, eq=False, kw_only=True)
class AdaptiveDelayDesign(DelayDesign):
    """By filtered regressors and a gradient."""

    gains: AdaptiveDelayGains

    example: ClassVar[str] = _EXAMPLE.format(
        also="",
        gains="""\
  filter_time: 0.05         # [s], of the regressors
  forgetting: 1             # [1/s]
  adaptation_gain: 100      # [s^2 per squared x]
""",
    )

    @cached_property
    def observer(self) -> AdaptiveDelayEstimator:
        """The estimator."""
        system, gains = self.system, self.gains
        return AdaptiveDelayEstimator(
            system.decay, system.input_gain, system.delay_bounds,
            gains.filter_time, gains.forgetting, gains.adaptation_gain,
            sampling_period=system.sampling_period,
        )  # fmt: skip

    @property
    def values(self) -> tuple[Signal, ...]:
        """x_f, g_f, phi_f, P and Q."""
        unit = self.unit
        return (
            Signal("filtered", unit), Signal("filtered_drive", product(unit, "1/s")),
            Signal("regressor", product(unit, "1/s^2")),
            Signal("excitation", product(unit, unit, "1/s^3")),
            Signal("correlation", product(unit, unit, "1/s^2")),
        )  # fmt: skip

    def certify(self) -> Certificate:
        """Poles of the filters, and the decay for a ramp, by its squared slope."""
        observer = self.observer
        poles = sorted([-1.0 / observer.filter_time, -observer.forgetting], reverse=True)
        squared = observer.input_gain * observer.input_gain
        decay = observer.adaptation_gain * squared / observer.forgetting
        if not np.isfinite(decay):
            raise InputError("adaptation_gain", f"{observer.adaptation_gain:g} is beyond numbers")
        return {"poles": [[pole, 0.0] for pole in poles], "decay_per_squared_slope": decay}

    def summary(self) -> list[str]:
        """Poles, and how fast errors decay."""
        known = self.certificate
        return [
            "delay by filtered regressors and a gradient, a reconstruction",
            f"poles: {told(known['poles'])} 1/s, of the filters",
            f"for an input that is a ramp errors decay by {known['decay_per_squared_slope']:.4g} "
            "1/s times its squared slope; for others, and from far off, convergence is not "
            "certified",
        ]


@dataclass(frozen=True, eq=False)
class RelayGains:
    """M, [1] on the delay or [1/s^2] on its inverse."""

    relay_gain: float
    relay_on: Literal["delay", "inverse"]


@dataclass(frozen=True, eq=False, kw_only=True)
class VariableStructureDelayDesign(DelayDesign):
    """By a relay on the delay or on its inverse."""

    gains: RelayGains

    measured: ClassVar[tuple[int, ...]] = (1, 2)
    example: ClassVar[str] = _EXAMPLE.format(
        also=" alone, or x and then x'",
        gains="""\
  relay_gain: 0.4           # speed of the delay, or per squared delay on the inverse [1/s^2]
  relay_on: inverse         # or delay
""",
    )

    @cached_property
    def observer(self) -> VariableStructureDelayEstimator:
        """The estimator."""
        system, gains = self.system, self.gains
        return VariableStructureDelayEstimator(
            system.decay, system.input_gain, system.delay_bounds,
            gains.relay_gain, gains.relay_on, sampling_period=system.sampling_period,
        )  # fmt: skip

    @property
    def values(self) -> tuple[Signal, ...]:
        """The delay alone."""
        return ()

    def certify(self) -> Certificate:
        """Least and greatest speed of the delay, and how far it chatters [s]."""
        inverse = self.gains.relay_on == "inverse"
        scales = np.array(self.system.delay_bounds) ** 2 if inverse else np.ones(2)
        with np.errstate(over="ignore"):
            slow, fast = (self.observer.relay_gain * scales).tolist()
        if not np.isfinite(fast):
            raise InputError("relay_gain", f"{self.observer.relay_gain:g} is beyond numbers")
        chatter = fast * self.observer.sampling_period
        return {"least_speed": slow, "greatest_speed": fast, "chatter": chatter}

    def summary(self) -> list[str]:
        """Speeds and chatter, and what they cost."""
        known = self.certificate
        slow, fast = known["least_speed"], known["greatest_speed"]
        lines = [
            f"delay by a relay on the {self.gains.relay_on}, a reconstruction".replace(
                "the inverse", "its inverse"
            ),
            f"the delay moves by {slow:.4g} to {fast:.4g} s a second, and is followed where it "
            f"changes less; it chatters by up to {known['chatter']:.4g} s",
        ]
        if fast >= 1:
            lines.append("a speed of 1 or more may lose the delay where the input turns round")
        lines.append(
            "while u' has one sign errors end in finite time; beyond, that is not certified"
        )
        return lines
