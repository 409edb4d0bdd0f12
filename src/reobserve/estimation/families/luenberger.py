"""Luenberger observer: a prediction, corrected by a constant gain, given or found by poles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray
from reobserve.estimation.families.kalman import MOTOR
from reobserve.estimation.families.linear_system import FilterDesign, LinearSystem, decay_sentences
from reobserve.estimation.families.poles import Poles, sampled_poles
from reobserve.estimation.observer_design import Certificate, Example, pairs
from reobserve.observers.fixed_gain import FixedGainObserver, luenberger
from reobserve.observers.gaussian_state import KalmanState

Array = FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class PlacedSystem(LinearSystem):
    """A linear system, and the poles that errors are to have."""

    poles: Poles | None = None


@dataclass(frozen=True, eq=False)
class LuenbergerGains:
    """L, shape (n, m)."""

    gain: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class LuenbergerDesign(FilterDesign):
    """An observer of constant gain."""

    system: PlacedSystem
    gains: LuenbergerGains

    programs: ClassVar = {FixedGainObserver: "filters:filter_program"}
    records: ClassVar = {
        "luenberger": Example(
            "motor", "# A Luenberger observer.\nobserver:\n  kind: luenberger\n" + MOTOR
            + "  poles: [-70.0, -50.0]      # [1/s], or of discrete time\n",
        ),
        "luenberger-gain": Example(
            "motor", "# Luenberger observer with a given gain.\n"
            "observer:\n  kind: luenberger\n" + MOTOR
            + "  gains: {gain: [[0.3, 0.2], [0.0, 0.4]]}\n",
        ),
    }  # fmt: skip

    @classmethod
    def find_gains(cls, system: PlacedSystem) -> LuenbergerGains:
        """The gain that gives the error the poles that the system states."""
        if system.poles is None:
            raise InputError("poles", "are missing, and so are gains; one of them must be stated")
        period = system.sampling_period if system.time == "continuous" else None
        gain = luenberger(system.model, sampled_poles("poles", system.poles, period)).gain
        return LuenbergerGains(gain)

    @cached_property
    def observer(self) -> FixedGainObserver:
        """The observer."""
        return FixedGainObserver(self.system.model, gain=self.gains.gain)

    def start(self) -> KalmanState:
        """The initial state, at the first sample."""
        return self.observer.init(self.system.mean, 0.0)

    def certify(self) -> Certificate:
        """Poles of the error."""
        poles = self.observer.poles
        return {"poles": pairs(poles), "spectral_radius": float(np.abs(poles[0]))}

    def summary(self) -> list[str]:
        """Poles, and how fast errors decay."""
        period = self.system.sampling_period
        return ["Luenberger observer", *decay_sentences(self.certificate, period)]
