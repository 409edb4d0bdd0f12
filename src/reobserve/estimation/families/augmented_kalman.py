"""Kalman filter of the state and of unknown inputs: faults, disturbances and biases of sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from reobserve.core.matrices import FloatArray
from reobserve.estimation.families.kalman import MOTOR, NOISE
from reobserve.estimation.families.linear_system import (
    FilterDesign,
    NoisySystem,
    check_shape,
    decay_sentences,
)
from reobserve.estimation.families.rules import rules
from reobserve.estimation.families.signals import NamedSignal, Signals, listed, numbered, variances
from reobserve.estimation.observer_design import Certificate, Example, pairs
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.fixed_gain import FixedGainObserver
from reobserve.synthesis.linear_gain import steady_kalman_gain

Array = FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class UnknownInputSystem(NoisySystem):
    """A linear system with x' = ... + E d and y = ... + F d, where d is a random walk.

    ``fault_matrix`` is E, sampled as A and B are; ``output_fault_matrix`` F, zero if left out. d
    starts from ``initial_unknown_input``, zero if left out, with a covariance, 1 if left out.
    """

    unknown_inputs: Signals = field(default_factory=dict)
    fault_matrix: Array
    output_fault_matrix: Array | None = None
    random_walk: Array
    initial_unknown_input: list[float] | None = None
    initial_unknown_input_covariance: Array = field(default_factory=lambda: np.array(1.0))

    def __post_init__(self) -> None:
        super().__post_init__()
        count = len(self.unknown_inputs)
        if count:
            check_shape("fault_matrix", self.fault_matrix, (len(self.A), count))


@dataclass(frozen=True, eq=False, kw_only=True)
class AugmentedKalmanDesign(FilterDesign):
    """A Kalman filter of state and unknown inputs."""

    system: UnknownInputSystem
    gains: None = None

    keys: ClassVar = {
        "unknown_input": "initial_unknown_input",
        "unknown_input_covariance": "initial_unknown_input_covariance",
    }  # fmt: skip
    programs: ClassVar = {AugmentedKalmanFilter: "filters:filter_program"}
    left_out: ClassVar = (*FilterDesign.left_out, "unknown_input_variance")
    records: ClassVar = {
        "augmented-kalman": Example(
            "weak_motor",
            "# Kalman filter for the state and an unknown input: the lost voltage."
            "\nobserver:\n  kind: augmented-kalman\n" + MOTOR + NOISE
            + "  unknown_inputs: {voltage_lost: V}\n"
            "  fault_matrix: [[0.0], [20.0]]   # how it enters the states, as B\n"
            "  random_walk: 0.1           # variance that it gains in a second [V^2/s]\n",
            "  - {name: weak, of: voltage_lost, beyond: 1.0}\n",
        ),
        "augmented-kalman-bias": Example(
            "biased_motor",
            "# Kalman filter for the state and the bias of a sensor.\n"
            "observer:\n  kind: augmented-kalman\n" + MOTOR + NOISE
            + "  unknown_inputs: {speed_offset: rad/s}\n"
            "  fault_matrix: [[0.0], [0.0]]    # it does not enter the states,\n"
            "  output_fault_matrix: [[1.0], [0.0]] # but adds to the first measurement\n"
            "  random_walk: 0.01          # variance that it gains in a second [(rad/s)^2/s]\n",
            "  - {name: biased, of: speed_offset, beyond: 0.5}\n",
        ),
    }  # fmt: skip

    @cached_property
    def observer(self) -> AugmentedKalmanFilter:
        """The filter."""
        system = self.system
        E = system.sampled(system.fault_matrix)  # one of another shape is the observer's to refuse
        return AugmentedKalmanFilter(
            system.model,
            fault_matrix=E,
            random_walk=system.random_walk,
            output_fault_matrix=system.output_fault_matrix,
            **rules(system),
        )

    @property
    def unknown_inputs(self) -> tuple[NamedSignal, ...]:
        """The components of d."""
        count = self.observer.unknown_inputs
        return listed(self.system.unknown_inputs) or numbered("unknown_input", count)

    @property
    def estimates(self) -> Mapping[str, tuple[NamedSignal, ...]]:
        """The estimates of a filter, and the unknown inputs."""
        return {
            **super().estimates, "unknown_input": self.unknown_inputs,
            "unknown_input_variance": variances(self.unknown_inputs),
        }  # fmt: skip

    def certify(self) -> Certificate:
        """Poles of the error of state and unknown inputs, with the gain of the filter at rest."""
        whole = self.observer.whole
        resting = FixedGainObserver(whole, gain=steady_kalman_gain(whole))
        return {"poles": pairs(resting.poles), "spectral_radius": float(np.abs(resting.poles[0]))}

    def summary(self) -> list[str]:
        """Poles, and how fast errors decay."""
        period = self.system.sampling_period
        return [
            "Kalman filter of state and unknown inputs",
            *decay_sentences(self.certificate, period),
        ]
