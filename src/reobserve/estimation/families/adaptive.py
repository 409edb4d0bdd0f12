"""Adaptive observer of a rigid body, with a proportional-integral fault estimate."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray
from reobserve.estimation.families.rigid_body import ALARMS, BODY, BodyDesign, BodySystem
from reobserve.estimation.observer_design import Certificate, Example, pairs, pole_text
from reobserve.observers.adaptive import AdaptiveObserver

Array = FloatArray


@dataclass(frozen=True, eq=False)
class AdaptiveGains:
    """Lambda and Kp [N m s/rad], Gamma [N m/rad], where Kp makes it the PI observer."""

    observer_gain: Array
    integral_gain: Array
    proportional_gain: Array = field(default_factory=lambda: np.array(0.0))


@dataclass(frozen=True, eq=False, kw_only=True)
class AdaptiveDesign(BodyDesign):
    """An adaptive observer with a proportional-integral fault estimate."""

    system: BodySystem
    gains: AdaptiveGains

    programs: ClassVar = {AdaptiveObserver: "integrating:rigid_body"}
    records: ClassVar = {
        "adaptive": Example(
            "satellite",
            "# Adaptive observer of a rigid body: the estimate of the fault is an integrator.\n"
            "observer:\n  kind: adaptive\n" + BODY + "  gains:\n"
            "    observer_gain: 100.0     # Lambda [N m s/rad]\n"
            "    integral_gain: 100.0     # Gamma [N m/rad]\n", ALARMS,
        ),
        "adaptive-pi": Example(
            "satellite",
            "# PI observer of a rigid body: an adaptive observer with a proportional part.\n"
            "observer:\n  kind: adaptive\n" + BODY + "  gains:\n"
            "    observer_gain: 100.0     # Lambda [N m s/rad]\n"
            "    integral_gain: 200.0     # Gamma [N m/rad]\n"
            "    proportional_gain: 30.0  # Kp [N m s/rad]\n", ALARMS,
        ),
    }  # fmt: skip

    @cached_property
    def observer(self) -> AdaptiveObserver:
        """The observer."""
        gains = self.gains
        return AdaptiveObserver(
            self.system.body, observer_gain=gains.observer_gain, integral_gain=gains.integral_gain,
            proportional_gain=gains.proportional_gain, sampling_period=self.system.sampling_period,
        )  # fmt: skip

    def certify(self) -> Certificate:
        """Poles of the errors of rate and fault, linearised at rest."""
        observer, body = self.observer, self.system.body
        injection = observer.observer_gain + body.fault_matrix @ observer.proportional_gain
        upper = np.hstack([-body.inverse @ injection, -body.inverse @ body.fault_matrix])
        lower = np.hstack([observer.integral_gain, np.zeros((3, 3))])
        poles = np.linalg.eigvals(np.vstack([upper, lower]))
        poles = poles[np.lexsort((poles.imag, -poles.real))]
        listed = pole_text(pairs(poles))
        if not poles.real.max() < 0:
            raise InputError(
                "observer_gain", f"and the other gains give errors with the poles {listed}"
            )
        step = poles * observer.sampling_period
        growth = np.abs(1 + step + step**2 / 2 + step**3 / 6 + step**4 / 24).max()
        if not growth < 1:
            raise InputError(
                "observer_gain",
                f"and the other gains give the poles {listed} 1/s, which steps of "
                f"{observer.sampling_period:g} s do not follow",
            )
        return {"poles": pairs(poles)}

    def summary(self) -> list[str]:
        """Poles."""
        return [
            "adaptive observer with a proportional-integral fault estimate",
            f"poles: {pole_text(self.certificate['poles'])} 1/s, of errors of rate and fault at "
            "rest",
        ]
