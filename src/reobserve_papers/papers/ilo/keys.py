"""The keys of the parameter file, as types."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from reobserve.core.validation import (
    Count,
    Levels,
    MatrixValue,
    NotNegative,
    Positive,
    Seed,
    Share,
    Terms,
    items,
    matrix,
    positive_definite,
    vector,
    within,
)
from reobserve_papers.parameters import job
from reobserve_papers.parameters.job import signal

Torque = Annotated[Terms, signal(3)]
Vector = Annotated[list[float], vector(3)]
Matrix = Annotated[MatrixValue, matrix(3)]


@dataclass(frozen=True)
class Plant:
    """The satellite, its control and its record."""

    inertia: Annotated[MatrixValue, positive_definite(3)]
    input_matrix: Matrix
    fault_matrix: Matrix
    initial_rate: Vector
    control: Torque
    horizon: Positive
    step: Positive
    noise: NotNegative
    noise_period: Positive


@dataclass(frozen=True)
class Scenario:
    """A fault of the thrusters."""

    fault: Torque
    title: str = ""


@dataclass(frozen=True)
class _Common:
    """Entries of all observers."""

    observer_gain: Matrix
    sampling_period: Positive
    inertia_factor: Positive
    initial_rate: Vector
    initial_fault: Vector


@dataclass(frozen=True)
class _Learning(_Common):
    K1: Matrix
    K2: Matrix
    update_interval: Positive


@dataclass(frozen=True)
class Sampled(_Learning):
    """An ILO that updates its estimate at sampling instants and holds it."""

    algorithm: Literal["sampled_ilo"]
    label: str = ""


@dataclass(frozen=True)
class Continuous(_Learning):
    """The ILO of the paper, updated continuously."""

    algorithm: Literal["continuous_ilo"]
    label: str = ""


@dataclass(frozen=True)
class Adaptive(_Common):
    """The observer that the paper compares with."""

    algorithm: Literal["adaptive"]
    integral_gain: Matrix
    proportional_gain: Matrix
    label: str = ""


Learning = Sampled | Continuous
VARIANTS: Mapping[str, type[Learning]] = {  # of (3): the type of each observer
    "sampled": Sampled,
    "continuous": Continuous,
    "forgetting": Continuous,
}
Observer = Sampled | Continuous | Adaptive


@dataclass(frozen=True, kw_only=True)
class Matching(job.Study):
    """The study of ILO and adaptive observers over gain and noise."""

    integral_gains: Levels
    damping_ratio: Positive
    noise_levels: Annotated[list[NotNegative], items()]
    shown_noise: NotNegative
    noise_runs: Count


@dataclass(frozen=True)
class Metrics:
    """Windows and thresholds of the metrics."""

    axis: Annotated[int, within(1, 3)]
    variant: Literal["sampled", "continuous", "forgetting"]
    settling_skip: Positive
    late_window: Positive
    residual_threshold: Positive


@dataclass(frozen=True)
class Theory:
    """Settings of the theory stage."""

    stuck: Torque
    random_seed: Seed
    cases: Annotated[int, within(20, 1_000_000)]
    learning_gains: Annotated[list[Share], items()]
    certified_designs: Count
    multiples: Annotated[list[Count], items()]
    slowdowns: Annotated[list[Count], items()]
    frequency: Positive
    intervals: Annotated[Levels, items(2)]
    frequencies: Levels
    accuracy: Positive
    start_rate: Vector
    fault_spacing: Positive
    fault_size: Positive
    largest_gain: Positive
    aperiodic: Torque
    noise: Positive
    inertia_error: Annotated[float, within(-0.9, 9.0)]
    adaptive_gain: Positive
    damping_ratio: Positive
    disturbance_frequency: Positive
    identity_variant: Literal["sampled", "continuous"]
    integration: Literal["euler", "runge_kutta"]
    periods_per_update: Count


@dataclass(frozen=True, kw_only=True)
class FaultFigure(job.Figure):
    """Fault, estimate and error over time."""

    layout: Literal["estimation"]


@dataclass(frozen=True, kw_only=True)
class MatchingFigure(job.StudyFigure):
    """The study."""

    layout: Literal["matching"]


Figure = FaultFigure | MatchingFigure


@dataclass(frozen=True)
class Parameters:
    """All sections."""

    plant: Plant
    scenarios: Mapping[str, Scenario]
    observers: Mapping[str, Annotated[Observer, Field(discriminator="algorithm")]]
    studies: Mapping[str, Matching]
    metrics: Metrics
    theory: Theory
    figures: Mapping[str, Annotated[Figure, Field(discriminator="layout")]]


Job = job.Job[Plant, Scenario, Observer, Metrics, Figure, Theory, Matching]
