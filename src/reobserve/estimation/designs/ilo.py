"""Design of an iterative learning observer of a rigid body: stable, and how accurate."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from reobserve.core.matrices import FloatArray, as_vector
from reobserve.estimation.designs.design import Certificate
from reobserve.estimation.designs.rigid_body import BodyDesign, BodySystem
from reobserve.observers.ilo import ILO
from reobserve.observers.ilo_sampled import SampledILO
from reobserve.synthesis.ilo_accuracy import predicted_rms_error
from reobserve.synthesis.ilo_error_system import LearningLaw
from reobserve.synthesis.ilo_sampled_stability import sampled_limit_gain, sampled_stability
from reobserve.synthesis.ilo_stability import continuous_stability

Array = FloatArray

EXAMPLE = """\
# A satellite whose rates are measured, and whose thrusters may fail.
reading: sampled            # v is updated once an interval and held; or continuous
sampling_period: 0.01       # [s]
states: {rate_x: rad/s, rate_y: rad/s, rate_z: rad/s}
inputs: {torque_x: N m, torque_y: N m, torque_z: N m}
inertia: [[36, 1.5, 0], [1.5, 17, 0], [0, 0, 26]]       # [kg m^2]
expected:                   # sines of a fault for which the error is predicted
  - {amplitude: [1, 0, 0], frequency: 10}               # [N m], [rad/s]
gains:
  K1: 1                     # learning: of the last v
  K2: 500                   # [N m s/rad] of the rate's error
  damping: 500              # [N m s/rad]
  update_interval: 0.01     # [s]
"""


@dataclass(frozen=True)
class Sine:
    """A part of a fault: ``amplitude`` [N m] of each axis, ``frequency`` [rad/s]."""

    amplitude: list[float]
    frequency: float

    def __post_init__(self) -> None:
        as_vector("amplitude", self.amplitude, 3)


@dataclass(frozen=True, eq=False, kw_only=True)
class LearningSystem(BodySystem):
    """A body, which way v is updated, and the fault that is expected."""

    reading: Literal["sampled", "continuous"]
    expected: list[Sine] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class LearningGains:
    """K1 [1], K2 and damping [N m s/rad], update_interval [s]."""

    K1: Array
    K2: Array
    damping: Array
    update_interval: float


@dataclass(frozen=True, eq=False, kw_only=True)
class IloDesign(BodyDesign):
    """An iterative learning observer."""

    system: LearningSystem
    gains: LearningGains
    certificate: Certificate = field(default_factory=dict)

    example: ClassVar[str] = EXAMPLE

    @cached_property
    def observer(self) -> ILO | SampledILO:
        """The observer; unstable gains are refused."""
        kind = SampledILO if self.system.reading == "sampled" else ILO
        gains = self.gains
        return kind(
            self.system.body,
            gains.K1,
            gains.K2,
            gains.damping,
            gains.update_interval,
            sampling_period=self.system.sampling_period,
        )

    def certify(self) -> Certificate:
        """Stability, and the predicted errors of the expected fault [N m]."""
        law, sampled = self.observer.law, self.system.reading == "sampled"
        certificate = _sampled(law) if sampled else _continuous(law)
        sines = self.system.expected
        if sines:
            errors = predicted_rms_error(
                [sine.amplitude for sine in sines], [sine.frequency for sine in sines], law,
                reading=self.system.reading,
            )  # fmt: skip
            for axis, error in zip("xyz", errors, strict=True):
                certificate[f"rms_error_{axis}"] = float(error)
        return certificate

    def summary(self) -> list[str]:
        """Stability and accuracy."""
        known = self.certificate
        lines = [f"iterative learning observer, {self.system.reading}: {known['verdict']}"]
        if self.system.reading == "sampled":
            lines.append(f"spectral radius of an update: {known['spectral_radius']:.6g}")
            if known["limit_gain"] is not None:
                lines.append(f"K2 may grow by a factor of {known['limit_gain']:.4g}")
        else:
            lines.append(f"worst factor of an interval: {known['worst_round_gain']:.6g}")
        errors = [known[f"rms_error_{a}"] for a in "xyz" if f"rms_error_{a}" in known]
        if errors:
            listed = ", ".join(f"{error:.4g}" for error in errors)
            lines.append(f"RMS error for the expected fault: {listed} N m")
        return lines


def _sampled(law: LearningLaw) -> Certificate:
    verdict, limit = sampled_stability(law), sampled_limit_gain(law)
    return {
        "verdict": verdict.verdict,
        "spectral_radius": verdict.spectral_radius,
        "limit_gain": float(limit) if np.isfinite(limit) else None,
    }


def _continuous(law: LearningLaw) -> Certificate:
    verdict = continuous_stability(law)
    return {
        "verdict": verdict.verdict,
        "learning_radius": verdict.learning_radius,
        "worst_round_gain": verdict.worst_round_gain,
    }
