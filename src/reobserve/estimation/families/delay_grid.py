"""A filter on a grid of delays of the inputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from reobserve.core.matrices import FloatArray
from reobserve.core.validation import NotNegative
from reobserve.estimation.families.linear_system import BankSystem, FilterDesign
from reobserve.estimation.families.rules import rules
from reobserve.estimation.families.signals import NamedSignal, covariances
from reobserve.estimation.observer_design import Certificate, Example
from reobserve.observers.grid_filter import GridFilter

Array = FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class DelayGridSystem(BankSystem):
    """A linear system whose inputs act after one of ``delays`` [s].

    ``random_walk`` and ``jump_rate`` say how the delay moves, see `GridFilter`; both zero if left
    out.
    """

    delays: Array
    random_walk: NotNegative = 0.0
    jump_rate: NotNegative = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class DelayGridDesign(FilterDesign):
    """A Kalman filter of the state for each delay of a grid."""

    system: DelayGridSystem
    gains: None = None

    programs: ClassVar = {GridFilter: "banks:bank_program"}
    left_out: ClassVar = (*FilterDesign.left_out, "covariance", "parameter_variance", "probability")
    records: ClassVar = {
        "delay-grid": Example(
            "lag",
            "# Kalman filters for a grid of delays of the valve.\nobserver:\n  kind: delay-grid\n"
            "  time: continuous\n"
            '  states: {level: "1"}\n'
            '  inputs: {valve: "1"}\n'
            '  measurements: {level: "1"}\n'
            "  A: [[-1.0]]                # level' = -level + 100 valve(t - delay)\n"
            "  B: [[1.0]]\n"
            "  C: [[1.0]]\n"
            "  delays: [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]   # [s]\n"
            "  random_walk: 0.0025        # variance that the delay gains in a second [s^2/s]\n"
            "  jump_rate: 0.0             # jumps a second to any other delay\n"
            "  Q: 1.0e-8                  # variance of the process noise per sample\n"
            "  R: 1.0e-6                  # of the measurement\n"
            "  initial_state: [0.0]\n"
            "  initial_covariance: 1.0\n",
        ),
    }  # fmt: skip

    @cached_property
    def observer(self) -> GridFilter:
        """The filter."""
        system = self.system
        return GridFilter.of_delay(
            system.model,
            delays=system.delays,
            random_walk=system.random_walk,
            jump_rate=system.jump_rate,
            **rules(system),
        )

    @property
    def estimates(self) -> Mapping[str, tuple[NamedSignal, ...]]:
        """State and delay, and the probabilities of the delays."""
        nodes = [f"{1e3 * delay:g}_ms".replace(".", "_") for delay in self.observer.grid]
        return {
            **super().estimates,
            "covariance": covariances(self.states),
            "parameter": (NamedSignal("delay", "s"),),
            "parameter_variance": (NamedSignal("delay_variance", "s^2"),),
            "probability": tuple(NamedSignal(f"probability_{node}", "1") for node in nodes),
            "innovation": tuple(
                NamedSignal(f"{signal.name}_innovation_{node}", signal.unit)
                for node in nodes
                for signal in self.measurements
            ),
        }  # fmt: skip

    def certify(self) -> Certificate:
        """The number of delays, and the probability that one is kept for a row, the least."""
        stay = np.diag(self.observer.transition)
        return {"delays": len(stay), "least_kept": float(stay.min())}

    def summary(self) -> list[str]:
        """The grid, and how the delay moves on it."""
        grid, least = self.observer.grid, self.certificate["least_kept"]
        return [
            f"Kalman filters for {len(grid)} delays from {grid[0]:g} s to {grid[-1]:g} s",
            f"a delay is kept from row to row with the probability {least:.6g} or more",
        ]
