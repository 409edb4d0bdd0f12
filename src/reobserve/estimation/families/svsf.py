"""Smooth variable structure filter: its boundary layers and convergence rate are chosen."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Literal

from reobserve.core.matrices import FloatArray
from reobserve.estimation.families.kalman import MOTOR, NOISE
from reobserve.estimation.families.linear_system import FilterDesign, NoisySystem
from reobserve.estimation.families.rules import rules
from reobserve.estimation.observer_design import Certificate, Example
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter

Array = FloatArray


@dataclass(frozen=True, eq=False)
class SwitchingGains:
    """psi in units of the measurements, gamma, and which inverse of C."""

    boundary_layer: Array
    convergence_rate: float
    inverse: Literal["pseudo", "weighted"] = "pseudo"


@dataclass(frozen=True, eq=False, kw_only=True)
class SvsfDesign(FilterDesign):
    """A smooth variable structure filter."""

    system: NoisySystem
    gains: SwitchingGains

    programs: ClassVar = {SmoothVariableStructureFilter: "filters:filter_program"}
    records: ClassVar = {
        "svsf": Example(
            "motor", "# Smooth variable structure filter.\nobserver:\n  kind: svsf\n"
            + MOTOR + NOISE + "  gains:\n"
            "    boundary_layer: [0.3, 0.1] # psi, in the units of the measurements\n"
            "    convergence_rate: 0.1      # gamma\n"
            "    inverse: pseudo            # of C; or weighted, by the covariance\n",
        ),
    }  # fmt: skip

    @cached_property
    def observer(self) -> SmoothVariableStructureFilter:
        """The filter."""
        gains = self.gains
        return SmoothVariableStructureFilter(
            self.system.model, boundary_layer=gains.boundary_layer,
            convergence_rate=gains.convergence_rate, inverse=gains.inverse,
            **rules(self.system),
        )  # fmt: skip

    def certify(self) -> Certificate:
        """Contraction of output errors outside the layers, if C is square, and other checks."""
        outputs, states = self.system.C.shape
        return {"contraction": self.observer.convergence_rate, "square": outputs == states}

    def summary(self) -> list[str]:
        """Sentences on what holds outside the boundary layers."""
        known = self.certificate
        lines = ["smooth variable structure filter"]
        if known["square"]:
            lines.append(
                f"outside the layers output errors shrink to {known['contraction']:g} a sample"
            )
        else:
            lines.append("fewer outputs than states: what the outputs do not see is not certified")
        return lines
