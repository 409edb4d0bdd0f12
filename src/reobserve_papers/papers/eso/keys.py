"""The keys of the parameter file, as types."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from reobserve.core.validation import (
    NotNegative,
    Positive,
    Terms,
    Window,
    array,
    distinct,
    items,
    vector,
)
from reobserve_papers.parameters import job
from reobserve_papers.parameters.job import signal

Fault = Annotated[Terms, signal(1)]
Pair = Annotated[list[float], vector(2)]
Poles = Annotated[list[float], vector(3)]
Column = Annotated[list[list[float]], array(2, 1)]
Square = Annotated[list[list[float]], array(2, 2)]
Changed = Annotated[list[Positive], items(0)]  # values to try, or none
Solver = Literal["CLARABEL", "SCS"]
Criterion = Literal["minimum_norm", "minimum_gamma"]
Solution = Literal["minimum_norm", "positive", "largest_margin"]


@dataclass(frozen=True)
class Plant:
    """The motor, its speed control, its disturbances, and the record."""

    inertia: Positive
    friction: Positive
    torque_constant: Positive
    emf_constant: Positive
    resistance: Positive
    inductance: Positive
    controller_poles: Poles
    feedback: Literal["state", "output"]
    reference: Fault
    pulse_width: Positive
    initial_state: Pair
    disturbance_matrix: Square
    noise_matrix: Column
    sensor_matrix: Column
    horizon: Positive
    step: Positive
    hold_period: Positive

    def noise_deviation(self, power: float) -> float:
        """Standard deviation of the held samples of white noise of this power."""
        return float(np.sqrt(power / self.hold_period))


@dataclass(frozen=True)
class Scenario:
    """Faults, disturbances and noise."""

    actuator_fault: Fault
    sensor_fault: Fault
    disturbance: Square  # minimum and maximum of each
    noise_power: NotNegative
    title: str = ""


@dataclass(frozen=True)
class Feasible:
    """Gains by feasibility with a decay rate."""

    kind: Literal["pi_feasible"]
    filter_rate: Positive
    decay: NotNegative
    solution: Solution  # of the inequality, see `synthesis.extended_state.pi`
    solver: Solver
    title: str = ""

    @property
    def name(self) -> str:
        """Name of the design in the study."""
        return self.kind if self.solution == "minimum_norm" else f"pi_{self.solution}"


@dataclass(frozen=True)
class Optimised:
    """Gains by optimisation, with one of two interpretations of "min gamma"."""

    kind: Literal["pi_optimised", "pd_pi_optimised"]
    filter_rate: Positive
    criterion: Criterion
    factor: Positive  # of gamma over its lower bound, for minimum_norm
    pole_bound: Positive  # for minimum_gamma, as the radius
    radius: Positive
    solver: Solver
    title: str = ""

    @property
    def name(self) -> str:
        """Name of the design in the study."""
        return f"{self.kind.removesuffix('_optimised')}_{self.criterion}"

    @property
    def level(self) -> float:
        """The level of the criterion that a study varies."""
        return self.factor if self.criterion == "minimum_norm" else self.pole_bound


Design = Feasible | Optimised


@dataclass(frozen=True)
class Observer:
    """An extended state observer with the gains of a design."""

    algorithm: Literal["extended_state"]
    design: str
    initial_estimate: Annotated[list[float], vector(6)]  # x, xz, fa, fs
    compared_with: str = ""  # the observer with which the estimates are compared
    label: str = ""


@dataclass(frozen=True, kw_only=True)
class Designs(job.Study):
    """The study of many designs."""

    method: Literal["designs"]
    observers: list[str]  # none: the study has its own designs
    filter_rates: Changed
    decays: Annotated[list[NotNegative], items(0)]
    solutions: Annotated[list[Solution], distinct]  # one PI observer for each
    factors: Changed
    pole_bounds: Changed
    radius: Positive  # with these bounds
    radii: Changed  # with the first of them
    solver: Solver


@dataclass(frozen=True)
class Metrics:
    """Settings of the metrics."""

    actuator_varying: Window
    actuator_constant: Window
    sensor_varying: Window
    sensor_constant: Window
    longest_lag: Positive
    visible: Positive  # V and rad/s


@dataclass(frozen=True)
class Theory:
    """Settings of the numbers of the theory."""

    fast_frequency: Positive  # of a sinusoidal fault [rad/s]
    settled_after: Positive  # a jump
    disturbance: Square
    noise_power: Positive


@dataclass(frozen=True, kw_only=True)
class Faults(job.Figure):
    """One fault and its estimates."""

    layout: Literal["actuator", "sensor"]


@dataclass(frozen=True, kw_only=True)
class DesignsFigure(job.StudyFigure):
    """The study."""

    layout: Literal["designs"]


Figure = Faults | DesignsFigure


@dataclass(frozen=True)
class Parameters:
    """All sections."""

    plant: Plant
    scenarios: Mapping[str, Scenario]
    designs: Mapping[str, Annotated[Design, Field(discriminator="kind")]]
    observers: Mapping[str, Observer]
    studies: Mapping[str, Designs]
    metrics: Metrics
    theory: Theory
    figures: Mapping[str, Annotated[Figure, Field(discriminator="layout")]]


Job = job.Job[Plant, Scenario, Observer, Metrics, Figure, Theory, Designs, Design]
