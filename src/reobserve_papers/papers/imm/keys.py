"""The keys of the parameter file, as types."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from pydantic import Field

from reobserve.core.errors import InputError
from reobserve.core.matrices import as_floats
from reobserve.core.validation import (
    MatrixValue,
    Names,
    NotNegative,
    Positive,
    Share,
    Terms,
    Window,
    as_stated,
    checked,
    items,
    vector,
    within,
)
from reobserve_papers.parameters import job
from reobserve_papers.parameters.job import signal

Coefficients = Annotated[list[float], vector(4)]
TestInput = Annotated[Terms, signal(1)]
Motion = Annotated[list[NotNegative], vector(4)]
SwitchingCondition = Literal["motion", "states", "outputs"]
Probability = Annotated[float, within(0, 1)]


def variances(place: str, value: Any) -> None:
    """A number for all, or one for each."""
    array = as_floats(place, value)
    if array.ndim > 2 or array.size > 100:
        raise InputError(place, f"has shape {array.shape}, must be a number, a list or a matrix")


def bounds(place: str, value: list[float]) -> None:
    """Two positive numbers, the second one larger."""
    low, high = value
    if not 0 < low < high:
        raise InputError(place, f"[{low:g}, {high:g}] must be above 0 and rise")


Variances = Annotated[MatrixValue, as_stated(variances)]
Bounds = Annotated[list[float], vector(2), checked(bounds)]


Changed = Annotated[list[Positive], items(0)]  # values to try, or none

# The identified models, in the order of all arrays with one component per mode.
MODES = ("normal", "friction", "leakage")


@dataclass(frozen=True)
class Plant:
    """The identified models of the actuator, by their transfer functions."""

    normal_numerator: Coefficients
    normal_denominator: Coefficients
    friction_numerator: Coefficients
    friction_denominator: Coefficients
    leakage_numerator: Coefficients
    leakage_denominator: Coefficients
    horizon: Positive


@dataclass(frozen=True)
class Scenario:
    """An input, a fault and the noise."""

    period: Positive
    input: TestInput
    input_unit: Literal["V", "rad/s"]
    fault: Literal["friction", "leakage"]
    share: NotNegative
    onset: Positive
    switching_condition: SwitchingCondition
    noise: Motion
    title: str = ""


@dataclass(frozen=True)
class _Bank:
    realisation: Literal["velocity", "derivatives", "motion", "observer_canonical"]
    process_noise: Variances
    measurement_noise: Variances
    self_transition: Annotated[float, Field(gt=0, le=1)]
    initial_covariance: Variances
    initial_mode: Literal["unknown", "normal"]
    mixing: bool
    quoted: Annotated[list[Probability], vector(2)]
    quoted_high: bool


@dataclass(frozen=True)
class Kalman(_Bank):
    """The KF-IMM."""

    algorithm: Literal["kalman"]
    label: str = ""


@dataclass(frozen=True)
class SmoothVariableStructure(_Bank):
    """The SVSF-IMM."""

    algorithm: Literal["smooth_variable_structure"]
    boundary_layer: Annotated[list[Positive], items(1, 4)]
    layer_scale: Positive
    layer_factor: Positive
    convergence_rate: NotNegative
    inverse: Literal["pseudo", "weighted"]
    label: str = ""


Observer = Kalman | SmoothVariableStructure


@dataclass(frozen=True)
class Search:
    """Bounds of the numbers that are tuned, and how they are sought."""

    scenario: str
    observers: Names
    process_noise: Bounds
    position_noise: Bounds
    velocity_noise: Bounds
    acceleration_noise: Bounds
    leave: Bounds
    population: Annotated[int, within(1, 1000)]
    neighbour_pairs: Annotated[int, within(0, 1000)]
    spread: Annotated[float, within(0, 0.99)]
    generations: Annotated[int, within(1, 100_000)]
    switching: Share | None = None  # no condition if missing
    title: str = ""


@dataclass(frozen=True, kw_only=True)
class Neighbourhood(job.Study):
    """Distances by which each tuned number may move before a quoted value leaves its band."""

    method: Literal["neighbourhood"]
    kept: str
    band: Share
    factors: Changed
    earlier_trials: Annotated[list[int], items(0)] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class Changes(job.Study):
    """The calibrated banks with one setting changed."""

    method: Literal["changes"]
    prbs: TestInput
    square: TestInput
    sweep: TestInput
    periods: Changed
    shares: Changed
    layer_factors: Changed
    initial_covariances: Changed
    noise: Motion


@dataclass(frozen=True, kw_only=True)
class Causes(job.Study):
    """Banks of SVSFs with one possible cause of their probabilities changed."""

    method: Literal["causes"]
    scales: Changed


@dataclass(frozen=True, kw_only=True)
class Frozen(job.Study):
    """Banks of SVSFs, and of filters with random gains, with their gains frozen."""

    method: Literal["frozen"]


Study = Neighbourhood | Changes | Causes | Frozen


@dataclass(frozen=True)
class Metrics:
    """Windows and levels of the metrics."""

    before: Window
    after: Window
    overshoot: Window
    alarm: Share
    band: Share


@dataclass(frozen=True)
class Theory:
    """The setting of the theory's numbers."""

    observers: Names
    period: Positive
    input: TestInput
    horizon: Positive
    onset: Positive
    switching_condition: SwitchingCondition
    layer_share: Annotated[float, Field(gt=0, lt=1)]


@dataclass(frozen=True, kw_only=True)
class OverTime(job.Figure):
    """Probabilities over time."""

    plain: str = ""  # the same with the plain setting, if this one's was searched for


@dataclass(frozen=True, kw_only=True)
class Probabilities(OverTime):
    """The probability of one mode."""

    layout: Literal["normal", "leakage"]


@dataclass(frozen=True, kw_only=True)
class Switching(OverTime):
    """The probabilities of all modes, beside a study that is not drawn."""

    layout: Literal["switching"]
    study: str


@dataclass(frozen=True, kw_only=True)
class BanksFigure(job.StudyFigure):
    """A study."""

    layout: Literal["neighbourhood", "changes", "causes"]


Figure = Probabilities | Switching | BanksFigure


@dataclass(frozen=True)
class Parameters:
    """All sections."""

    plant: Plant
    scenarios: Mapping[str, Scenario]
    observers: Mapping[str, Annotated[Observer, Field(discriminator="algorithm")]]
    searches: Mapping[str, Search]
    studies: Mapping[str, Annotated[Study, Field(discriminator="method")]]
    theory: Theory
    metrics: Metrics
    figures: Mapping[str, Annotated[Figure, Field(discriminator="layout")]]


Job = job.Job[Plant, Scenario, Observer, Metrics, Figure, Theory, Study, None, Search]
