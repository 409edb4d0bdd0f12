"""Kalman filter: with the covariance in time, or with the gain that it comes to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray
from reobserve.estimation.families.linear_system import FilterDesign, NoisySystem, decay_sentences
from reobserve.estimation.families.rules import rules
from reobserve.estimation.observer_design import Certificate, Example, pairs
from reobserve.observers.fixed_gain import FixedGainObserver
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.kalman import KalmanFilter
from reobserve.synthesis.linear_gain import kalman_gain_error, steady_kalman_gain

Array = FloatArray

MOTOR = """\
  time: continuous           # discretised here; or discrete
  states: {speed: rad/s, current: A}
  inputs: {voltage: V}       # held from sample to sample
  measurements: {speed: rad/s, current: A}
  A: [[-10.0, 40.0], [-0.4, -20.0]]
  B: [[0.0], [20.0]]
  C: [[1.0, 0.0], [0.0, 1.0]]
"""
NOISE = """\
  Q: [1.0e-4, 1.0e-4]        # variances of the process noise per sample
  R: [1.0e-3, 1.0e-4]        # of the measurements
  initial_state: [0.0, 0.0]
  initial_covariance: 1.0
"""


@dataclass(frozen=True, eq=False, kw_only=True)
class KalmanSystem(NoisySystem):
    """A linear system with noise, and whether the gain is the steady one."""

    gain: Literal["varying", "steady"] = "varying"


@dataclass(frozen=True, eq=False)
class KalmanGains:
    """K at rest, shape (n, m)."""

    gain: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class KalmanDesign(FilterDesign):
    """A Kalman filter."""

    system: KalmanSystem
    gains: KalmanGains | None = None

    programs: ClassVar = dict.fromkeys((KalmanFilter, FixedGainObserver), "filters:filter_program")
    records: ClassVar = {
        "kalman": Example(
            "motor", "# Kalman filter.\nobserver:\n  kind: kalman\n" + MOTOR + NOISE,
            "  - {name: odd, of: residual speed, sigma: 6, since: 1, until: 4}"
            "  # learned from 1 s to 4 s\n",
        ),
        "kalman-steady": Example(
            "motor", "# Kalman filter with its steady-state gain.\n"
            "observer:\n  kind: kalman\n  gain: steady\n" + MOTOR + NOISE,
        ),
    }  # fmt: skip

    def __post_init__(self) -> None:
        if (self.gains is None) != (self.system.gain == "varying"):
            wanted = "are missing" if self.gains is None else "must be left out"
            raise InputError("gains", f"{wanted} where the gain is {self.system.gain}")

    @classmethod
    def find_gains(cls, system: KalmanSystem) -> KalmanGains | None:
        """The gain at rest, if the system asks for it."""
        return KalmanGains(steady_kalman_gain(system.model)) if system.gain == "steady" else None

    @cached_property
    def observer(self) -> GaussianFilter:
        """The filter."""
        options = rules(self.system)
        if self.gains is None:
            return KalmanFilter(self.system.model, **options)
        return FixedGainObserver(self.system.model, gain=self.gains.gain, **options)

    def certify(self) -> Certificate:
        """Poles of the error at rest, the gain against the Riccati equation's.

        Raises
        ------
        InputError
            If there is no gain at rest, or the gain is another.
        """
        steady = steady_kalman_gain(self.system.model)
        gain = steady if self.gains is None else self.gains.gain
        resting = FixedGainObserver(self.system.model, gain=gain)  # refuses other shapes
        off = kalman_gain_error(self.system.model, resting.gain)
        if off.max() > 1e-6:
            worst = np.unravel_index(np.argmax(off), steady.shape)
            raise InputError(
                f"gain[{worst[0]}][{worst[1]}]",
                f"is {resting.gain[worst]:.9g}, the Riccati equation gives {steady[worst]:.9g}",
            )
        return {"poles": pairs(resting.poles), "spectral_radius": float(np.abs(resting.poles[0]))}

    def summary(self) -> list[str]:
        """Poles, and how fast errors decay."""
        text = "gain that follows the covariance" if self.gains is None else "steady gain"
        period = self.system.sampling_period
        return [f"Kalman filter, {text}", *decay_sentences(self.certificate, period)]
