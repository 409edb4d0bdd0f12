"""Iterative learning observer of a rigid body: stability and accuracy."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray, as_vector, spectral_radius
from reobserve.estimation.families.rigid_body import ALARMS, BODY, BodyDesign, BodySystem
from reobserve.estimation.observer_design import Certificate, Example
from reobserve.observers.ilo import ILO, SampledILO
from reobserve.synthesis.ilo_accuracy import predicted_rms_error
from reobserve.synthesis.ilo_error_system import LearningLaw
from reobserve.synthesis.ilo_sampled_stability import sampled_limit_gain, sampled_stability
from reobserve.synthesis.ilo_stability import continuous_stability

Array = FloatArray

_RECORD = """\
# Iterative learning observer of a rigid body: fault torques from angular rates.
observer:
  kind: ilo
  variant: {0}               # {1}
{body}  expected:                  # sines of a fault, of which a design predicts the error
    - {{amplitude: [1, 0, 0], frequency: 1}}    # [N m], [rad/s]
  gains:
    K1: {K1}                 # a number, a diagonal or 3 x 3
    K2: 20.0                 # [N m s/rad]
    observer_gain: 100.0     # Lambda [N m s/rad]
    update_interval: 0.01    # tau [s]
"""


@dataclass(frozen=True)
class FaultSine:
    """A part of a fault: ``amplitude`` [N m] of each axis, ``frequency`` [rad/s]."""

    amplitude: list[float]
    frequency: float

    def __post_init__(self) -> None:
        as_vector("amplitude", self.amplitude, 3)


@dataclass(frozen=True, eq=False, kw_only=True)
class LearningSystem(BodySystem):
    """A body, which way v is updated, and the fault that is expected.

    ``forgetting`` is the continuous update with K1 of a spectral radius below 1.
    """

    variant: Literal["sampled", "continuous", "forgetting"] = "sampled"
    expected: list[FaultSine] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class LearningGains:
    """K1 [1], K2 and Lambda [N m s/rad], update_interval [s], a sampling period if left out."""

    K1: Array
    K2: Array
    observer_gain: Array
    update_interval: float | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class IloDesign(BodyDesign):
    """An iterative learning observer."""

    system: LearningSystem
    gains: LearningGains

    keys: ClassVar = {**BodyDesign.keys, "frequencies": "expected"}
    programs: ClassVar = dict.fromkeys((SampledILO, ILO), "integrating:rigid_body")
    records: ClassVar = {
        f"ilo-{variant}": Example("satellite", _RECORD.format(variant, about, body=BODY, K1=K1),
                                  ALARMS)
        for variant, about, K1 in (
            ("sampled", "v is updated once an interval and held", 1.0),
            ("continuous", "v is updated at every instant", 1.0),
            ("forgetting", "as continuous, with K1 below 1", 0.99),
        )
    }  # fmt: skip

    @cached_property
    def observer(self) -> ILO | SampledILO:
        """The observer, unless its gains are unstable, which is refused."""
        kind = SampledILO if self.system.variant == "sampled" else ILO
        gains, period = self.gains, self.system.sampling_period
        interval = period if gains.update_interval is None else gains.update_interval
        observer = kind(
            self.system.body, K1=gains.K1, K2=gains.K2, observer_gain=gains.observer_gain,
            update_interval=interval, sampling_period=period,
        )  # fmt: skip
        radius = spectral_radius(observer.K1)
        if self.system.variant == "forgetting" and radius >= 1.0:
            problem = f"has the spectral radius {radius:g}; to forget, it must be below 1"
            raise InputError("K1", problem)
        return observer

    def certify(self) -> Certificate:
        """Stability, and the predicted errors of the expected fault [N m]."""
        law, sampled = self.observer.law, self.system.variant == "sampled"
        certificate = _sampled(law) if sampled else _continuous(law)
        sines = self.system.expected
        if sines:
            errors = predicted_rms_error(
                [sine.amplitude for sine in sines], [sine.frequency for sine in sines], law,
                variant="sampled" if sampled else "continuous",
            )  # fmt: skip
            for axis, error in zip("xyz", errors, strict=True):
                certificate[f"rms_error_{axis}"] = float(error)
        return certificate

    def summary(self) -> list[str]:
        """Stability and accuracy."""
        known = self.certificate
        lines = [f"iterative learning observer, {self.system.variant}: {known['verdict']}"]
        if self.system.variant == "sampled":
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
