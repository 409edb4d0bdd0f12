"""Interacting multiple model: the modes that a plant may be in, and their Markov chain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from reobserve.core.errors import InputError, located
from reobserve.core.matrices import FloatArray
from reobserve.estimation.families.kalman import MOTOR, NOISE
from reobserve.estimation.families.linear_system import (
    BankSystem,
    FilterDesign,
    LinearSystem,
    unobserved,
)
from reobserve.estimation.families.rules import rules
from reobserve.estimation.families.signals import NamedSignal, check_signals, covariances
from reobserve.estimation.observer_design import Certificate, Example
from reobserve.observers.gaussian_filter import GaussianFilter
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.smooth_variable_structure import SmoothVariableStructureFilter

Array = FloatArray

_MODES = """\
  modes:                     # each states the matrices in which it differs
    healthy: {}
    worn: {A: [[-20.0, 40.0], [-0.4, -20.0]]}
  gains:
    transition: [[0.999, 0.001], [0.001, 0.999]]   # from one sample to the next
"""
_ALARM = "  - {name: worn, of: probability_worn, above: 0.9}\n"
_MOST_MODES = 50


@dataclass(frozen=True, eq=False, kw_only=True)
class Mode:
    """Differences of a mode from the others."""

    A: Array | None = None
    B: Array | None = None
    C: Array | None = None
    D: Array | None = None
    Q: Array | None = None
    R: Array | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class ManyModes(BankSystem):
    """A linear system in several modes, with their probabilities at the start, equal if left out.

    The covariance of the initial state is that of all modes.
    """

    modes: dict[str, Mode]
    initial_probabilities: list[float] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_signals("modes", dict.fromkeys(self.modes, "1"))
        if not 1 <= len(self.modes) <= _MOST_MODES:
            raise InputError("modes", f"has {len(self.modes)} modes, must have 1 to {_MOST_MODES}")

    @cached_property
    def systems(self) -> dict[str, LinearSystem]:
        """The linear system of each mode, or `InputError` with the mode that has none."""
        shared = {each.name: getattr(self, each.name) for each in fields(LinearSystem)}
        systems = {}
        for name, mode in self.modes.items():
            changed = {key: value for key, value in vars(mode).items() if value is not None}
            with located(f"modes.{name}"):
                systems[name] = LinearSystem(**{**shared, **changed})
                _ = systems[name].model
        return systems


@dataclass(frozen=True, eq=False, kw_only=True)
class BankGains:
    """The filter of all modes, the chain's probabilities, and whether estimates are mixed."""

    filter: Literal["kalman", "svsf"] = "kalman"
    transition: Array
    mixing: bool = True
    boundary_layer: Array | None = None
    convergence_rate: float | None = None
    inverse: Literal["pseudo", "weighted"] = "pseudo"

    def __post_init__(self) -> None:
        for name in ("boundary_layer", "convergence_rate"):
            if (getattr(self, name) is None) != (self.filter == "kalman"):
                wanted = "must be left out" if self.filter == "kalman" else "is missing"
                raise InputError(name, f"{wanted} with the filter {self.filter}")


@dataclass(frozen=True, eq=False, kw_only=True)
class ImmDesign(FilterDesign):
    """An interacting multiple model."""

    system: ManyModes
    gains: BankGains

    keys: ClassVar = {"probabilities": "initial_probabilities"}
    programs: ClassVar = {IMM: "banks:bank_program"}
    left_out: ClassVar = (*FilterDesign.left_out, "covariance")
    records: ClassVar = {
        "imm-kalman": Example(
            "worn_motor", "# Bank of Kalman filters: which of several models does the record "
            "follow?\nobserver:\n  kind: imm\n" + MOTOR + NOISE + _MODES
            + "    filter: kalman\n", _ALARM,
        ),
        "imm-svsf": Example(
            "worn_motor", "# Bank of SVSFs: which of several models does the record follow?\n"
            "observer:\n  kind: imm\n" + MOTOR + NOISE + _MODES + "    filter: svsf\n"
            "    boundary_layer: [0.3, 0.1] # psi, in the units of the measurements\n"
            "    convergence_rate: 0.1      # gamma\n", _ALARM,
        ),
    }  # fmt: skip

    @cached_property
    def observer(self) -> IMM:
        """The bank."""
        gains = self.gains
        filters: list[GaussianFilter] = []
        for system in self.system.systems.values():
            if gains.boundary_layer is None or gains.convergence_rate is None:
                filters.append(KalmanFilter(system.model))
            else:
                layer, rate = gains.boundary_layer, gains.convergence_rate
                filters.append(
                    SmoothVariableStructureFilter(
                        system.model,
                        boundary_layer=layer,
                        convergence_rate=rate,
                        inverse=gains.inverse,
                    )
                )
        return IMM(filters, gains.transition, mixing=gains.mixing, **rules(self.system))

    @property
    def estimates(self) -> Mapping[str, tuple[NamedSignal, ...]]:
        """Mixture, probabilities of modes, innovations of all filters."""
        modes = tuple(self.system.modes)
        return {
            **super().estimates,
            "covariance": covariances(self.states),
            "probability": tuple(NamedSignal(f"probability_{mode}", "1") for mode in modes),
            "innovation": tuple(
                NamedSignal(f"{mode}_{signal.name}_innovation", signal.unit)
                for mode in modes
                for signal in self.measurements
            ),
        }

    @property
    def unseen(self) -> tuple[str, ...]:
        """Modes of each model that stay as they start."""
        systems = self.system.systems.items()
        return tuple(
            sentence for name, system in systems
            for sentence in unobserved(system.model, f"modes.{name}")
        )  # fmt: skip

    def certify(self) -> Certificate:
        """The time that the chain stays in each mode on average, in samples."""
        chain = self.observer.transition
        stay = [min(float(1.0 / max(1.0 - p, 1e-300)), 1e300) for p in np.diag(chain)]
        return {f"samples_in_{mode}": s for mode, s in zip(self.system.modes, stay, strict=True)}

    def summary(self) -> list[str]:
        """Sentences on how long the chain stays in each mode."""
        period = self.system.sampling_period
        lines = [f"interacting multiple model of {len(self.system.modes)} modes"]
        for mode in self.system.modes:
            seconds = self.certificate[f"samples_in_{mode}"] * period
            lines.append(f"{mode}: stays for {seconds:.4g} s on average")
        return lines
