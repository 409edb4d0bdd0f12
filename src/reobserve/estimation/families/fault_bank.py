"""A bank of Kalman filters for faults that jump or drift."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from reobserve.core.matrices import FloatArray
from reobserve.core.validation import Positive
from reobserve.estimation.families.kalman import MOTOR, NOISE
from reobserve.estimation.families.linear_system import BankSystem, FilterDesign, check_shape
from reobserve.estimation.families.rules import rules
from reobserve.estimation.families.signals import (
    NamedSignal,
    Signals,
    covariances,
    listed,
    numbered,
    product,
    variances,
)
from reobserve.estimation.observer_design import Certificate, Example
from reobserve.observers.fault_bank import FaultBank

Array = FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class FaultBankSystem(BankSystem):
    """A linear system with x' = ... + E f and y = ... + F f of faults f that jump or drift.

    ``fault_matrix`` is E, sampled as A and B are; ``output_fault_matrix`` F, zero if left out; the
    other keys are those of `FaultBank`. Faults and their rates start from zero, with
    ``initial_fault_covariance`` and ``initial_rate_covariance``, which may be left out.
    """

    faults: Signals = field(default_factory=dict)
    fault_matrix: Array
    output_fault_matrix: Array | None = None
    drift: Array
    jump: Array
    jump_rate: Positive
    jump_time: Positive
    initial_fault_covariance: Array | None = None
    initial_rate_covariance: Array | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.faults:
            check_shape("fault_matrix", self.fault_matrix, (len(self.A), len(self.faults)))


@dataclass(frozen=True, eq=False, kw_only=True)
class FaultBankDesign(FilterDesign):
    """A bank of Kalman filters of state and faults."""

    system: FaultBankSystem
    gains: None = None

    keys: ClassVar = {
        "fault_covariance": "initial_fault_covariance",
        "rate_covariance": "initial_rate_covariance",
    }
    programs: ClassVar = {FaultBank: "banks:bank_program"}
    left_out: ClassVar = (
        *FilterDesign.left_out, "covariance", "fault_variance", "fault_rate",
        "fault_rate_variance",
    )  # fmt: skip
    records: ClassVar = {
        "fault-bank": Example(
            "weak_motor",
            "# Bank of Kalman filters for a fault that jumps or drifts: the lost voltage."
            "\nobserver:\n  kind: fault-bank\n" + MOTOR + NOISE
            + "  faults: {voltage_lost: V}\n"
            "  fault_matrix: [[0.0], [20.0]]   # how it enters the states, as B\n"
            "  drift: 0.1                 # what its rate gains in a second [V/s per sqrt(s)]\n"
            "  jump: 20.0                 # what it gains in a second in a jump [V per sqrt(s)]\n"
            "  jump_rate: 0.1             # jumps a second\n"
            "  jump_time: 0.05            # mean time [s] that one takes\n",
            "  - {name: weak, of: voltage_lost, beyond: 1.0}\n",
        ),
    }  # fmt: skip

    @cached_property
    def observer(self) -> FaultBank:
        """The bank."""
        system = self.system
        E = system.sampled(system.fault_matrix)  # one of another shape is the observer's to refuse
        return FaultBank(
            system.model, fault_matrix=E, drift=system.drift, jump=system.jump,
            jump_rate=system.jump_rate, jump_time=system.jump_time,
            output_fault_matrix=system.output_fault_matrix, **rules(system),
        )  # fmt: skip

    @property
    def faults(self) -> tuple[NamedSignal, ...]:
        """The components of f."""
        return listed(self.system.faults) or numbered("fault", self.observer.faults)

    @property
    def estimates(self) -> Mapping[str, tuple[NamedSignal, ...]]:
        """State, faults and their rates, and the probabilities of the modes."""
        modes = ("drifting", *(f"{fault.name}_jumps" for fault in self.faults))
        rates = tuple(
            NamedSignal(f"{fault.name}_rate", product(fault.unit, "1/s")) for fault in self.faults
        )
        return {
            **super().estimates,
            "covariance": covariances(self.states),
            "fault": self.faults, "fault_variance": variances(self.faults),
            "fault_rate": rates, "fault_rate_variance": variances(rates),
            "probability": tuple(NamedSignal(f"probability_{mode}", "1") for mode in modes),
            "innovation": tuple(
                NamedSignal(f"{mode}_{signal.name}_innovation", signal.unit)
                for mode in modes
                for signal in self.measurements
            ),
        }  # fmt: skip

    def certify(self) -> Certificate:
        """The rows that a jump takes in the mean, and those between two."""
        bank = self.observer
        stay = np.diag(bank.transition)
        return {
            "rows_between_jumps": float(1.0 / (1.0 - stay[0])),
            "rows_of_a_jump": float(1.0 / (1.0 - stay[1])),
        }

    def summary(self) -> list[str]:
        """Sentences on how often faults jump."""
        period = self.system.sampling_period
        between, long = (
            self.certificate[name] * period for name in ("rows_between_jumps", "rows_of_a_jump")
        )
        return [
            f"bank of {1 + self.observer.faults} Kalman filters for faults that jump or drift",
            f"a jump every {between:.4g} s in the mean, which takes {long:.4g} s",
        ]
