"""The keys of the parameter file, as types."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

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
from reobserve_papers.parameters.units import PURE, SECONDS, TIMING, Duration, Unit

RATE = Unit("rad/s")
Torque = Annotated[Terms, signal(3), Unit("N m", beside=("N m/s", *TIMING))]
Vector = Annotated[list[float], vector(3)]
Matrix = Annotated[MatrixValue, matrix(3)]
Gain = Annotated[Matrix, Unit("N m s/rad")]


@dataclass(frozen=True)
class Plant:
    """The satellite, its control and its record."""

    inertia: Annotated[MatrixValue, positive_definite(3), Unit("kg m^2")]
    input_matrix: Annotated[Matrix, PURE]
    fault_matrix: Annotated[Matrix, PURE]
    initial_rate: Annotated[Vector, RATE]
    control: Torque
    horizon: Duration
    step: Duration
    noise: Annotated[NotNegative, RATE]
    noise_period: Duration


@dataclass(frozen=True)
class Scenario:
    """A fault of the thrusters."""

    fault: Torque
    title: str = ""


@dataclass(frozen=True)
class _Common(job.Observer):
    """Entries of all observers."""

    observer_gain: Gain
    inertia_factor: Annotated[Positive, PURE]
    initial_rate: Annotated[Vector, RATE]
    initial_fault: Annotated[Vector, Unit("N m")]


@dataclass(frozen=True)
class _Learning(_Common):
    K1: Annotated[Matrix, PURE]
    K2: Gain
    update_interval: Duration


@dataclass(frozen=True)
class Sampled(_Learning):
    """An ILO that updates its estimate at sampling instants and holds it."""

    algorithm: Literal["sampled_ilo"]


@dataclass(frozen=True)
class Continuous(_Learning):
    """The ILO of the paper, updated continuously."""

    algorithm: Literal["continuous_ilo"]


@dataclass(frozen=True)
class Adaptive(_Common):
    """The observer that the paper compares with."""

    algorithm: Literal["adaptive"]
    integral_gain: Annotated[Matrix, Unit("N m/rad")]
    proportional_gain: Gain


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

    integral_gains: Annotated[Levels, Unit("N m/rad")]
    damping_ratio: Annotated[Positive, PURE]
    noise_levels: Annotated[list[NotNegative], items(), RATE]
    shown_noise: Annotated[NotNegative, RATE]
    noise_runs: Annotated[Count, PURE]


@dataclass(frozen=True)
class Metrics:
    """Windows and thresholds of the metrics."""

    axis: Annotated[int, within(1, 3), PURE]
    variant: Literal["sampled", "continuous", "forgetting"]
    settling_skip: Duration
    late_window: Duration
    residual_threshold: Annotated[Positive, Unit("N m")]


@dataclass(frozen=True)
class Theory:
    """Settings of the theory stage."""

    stuck: Torque
    random_seed: Annotated[Seed, PURE]
    cases: Annotated[int, within(20, 1_000_000), PURE]
    learning_gains: Annotated[list[Share], items(), PURE]
    certified_designs: Annotated[Count, PURE]
    multiples: Annotated[list[Count], items(), PURE]
    slowdowns: Annotated[list[Count], items(), PURE]
    frequency: Annotated[Positive, RATE]
    intervals: Annotated[Levels, items(2), SECONDS]
    frequencies: Annotated[Levels, RATE]
    accuracy: Annotated[Positive, PURE]
    start_rate: Annotated[Vector, RATE]
    fault_spacing: Duration
    fault_size: Annotated[Positive, Unit("N m")]
    largest_gain: Annotated[Positive, Unit("N m s/rad")]
    aperiodic: Torque
    noise: Annotated[Positive, RATE]
    inertia_error: Annotated[float, within(-0.9, 9.0), PURE]
    adaptive_gain: Annotated[Positive, Unit("N m/rad")]
    damping_ratio: Annotated[Positive, PURE]
    disturbance_frequency: Annotated[Positive, RATE]
    identity_variant: Literal["sampled", "continuous"]
    integration: Literal["euler", "runge_kutta"]
    periods_per_update: Annotated[Count, PURE]


@dataclass(frozen=True, kw_only=True)
class FaultFigure(job.Figure):
    """Fault, estimate and error over time."""

    layout: Literal["estimation"]


@dataclass(frozen=True, kw_only=True)
class MatchingFigure(job.StudyFigure):
    """The study."""

    layout: Literal["matching"]


Figure = FaultFigure | MatchingFigure


Job = job.Job[Plant, Scenario, Observer, Metrics, Figure, Theory, Matching]
Parameters = job.sections(Job)
