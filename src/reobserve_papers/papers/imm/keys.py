"""The keys of the parameter file, as types."""

from __future__ import annotations

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
    as_stated,
    checked,
    items,
    vector,
    within,
)
from reobserve_papers.parameters import job
from reobserve_papers.parameters.job import signal
from reobserve_papers.parameters.units import PURE, SECONDS, TIMING, Duration, Span, Unit, UnitBy

Numerator = Annotated[list[float], vector(4), Unit("y/u s^-1 to s^-4")]
Denominator = Annotated[list[float], vector(4), Unit("s^-1 to s^-4")]
TestInput = Annotated[Terms, signal(1), Unit("V", beside=("V/s", *TIMING))]
INPUT = UnitBy(
    "input_unit",
    {
        unit: Unit(unit, beside=(rate, *TIMING))
        for unit, rate in (("V", "V/s"), ("rad/s", "rad/s^2"))
    },
)
Motion = Annotated[list[NotNegative], vector(4), Unit("y s, y, y/s, y/s^2")]
SwitchingCondition = Literal["motion", "states", "outputs"]
Probability = Annotated[float, within(0, 1), PURE]


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
# Of position, velocity, acceleration and jerk, or of those that a realisation measures.
NOISE = Unit(
    "(y s)^2, y^2, (y/s)^2, (y/s^2)^2", "(y s)^2, y^2, (y/s)^2", "y^2, (y/s)^2, (y/s^2)^2", "y^2"
)


Changed = Annotated[list[Positive], items(0)]  # values to try, or none

# The identified models, in the order of all arrays with one component per mode.
MODES = ("normal", "friction", "leakage")


@dataclass(frozen=True)
class Plant:
    """The identified models of the actuator, by their transfer functions."""

    normal_numerator: Numerator
    normal_denominator: Denominator
    friction_numerator: Numerator
    friction_denominator: Denominator
    leakage_numerator: Numerator
    leakage_denominator: Denominator
    horizon: Duration


@dataclass(frozen=True)
class Scenario:
    """An input, a fault and the noise."""

    period: Duration
    input: Annotated[Terms, signal(1), INPUT]
    input_unit: Literal["V", "rad/s"]
    fault: Literal["friction", "leakage"]
    share: Annotated[NotNegative, PURE]
    onset: Duration
    switching_condition: SwitchingCondition
    noise: Motion
    title: str = ""


@dataclass(frozen=True)
class _Bank:
    realisation: Literal["velocity", "derivatives", "motion", "observer_canonical"]
    process_noise: Annotated[Variances, Unit("y^2")]
    measurement_noise: Annotated[Variances, NOISE]
    self_transition: Annotated[float, Field(gt=0, le=1), PURE]
    initial_covariance: Annotated[Variances, Unit("y^2")]
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
    boundary_layer: Annotated[
        list[Positive], items(1, 4), Unit("y s, y, y/s", "y, y/s, y/s^2", "y")
    ]
    layer_scale: Annotated[Positive, PURE]
    layer_factor: Annotated[Positive, PURE]
    convergence_rate: Annotated[NotNegative, PURE]
    inverse: Literal["pseudo", "weighted"]
    label: str = ""


Observer = Kalman | SmoothVariableStructure


@dataclass(frozen=True)
class Search:
    """Bounds of the numbers that are tuned, and how they are sought."""

    scenario: str
    observers: Names
    process_noise: Annotated[Bounds, Unit("y^2")]
    position_noise: Annotated[Bounds, Unit("(y s)^2")]
    velocity_noise: Annotated[Bounds, Unit("y^2")]
    acceleration_noise: Annotated[Bounds, Unit("(y/s)^2")]
    leave: Annotated[Bounds, PURE]
    population: Annotated[int, within(1, 1000), PURE]
    neighbour_pairs: Annotated[int, within(0, 1000), PURE]
    spread: Annotated[float, within(0, 0.99), PURE]
    generations: Annotated[int, within(1, 100_000), PURE]
    switching: Annotated[Share, PURE] | None = None  # no condition if missing
    title: str = ""


@dataclass(frozen=True, kw_only=True)
class Neighbourhood(job.Study):
    """Distances by which each tuned number may move before a quoted value leaves its band."""

    method: Literal["neighbourhood"]
    kept: Annotated[str, Unit("file")]
    band: Annotated[Share, PURE]
    factors: Annotated[Changed, PURE]
    earlier_trials: Annotated[list[int], items(0), PURE] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class Changes(job.Study):
    """The calibrated banks with one setting changed."""

    method: Literal["changes"]
    prbs: TestInput
    square: TestInput
    sweep: TestInput
    periods: Annotated[Changed, SECONDS]
    shares: Annotated[Changed, PURE]
    layer_factors: Annotated[Changed, PURE]
    initial_covariances: Annotated[Changed, Unit("y^2")]
    noise: Motion


@dataclass(frozen=True, kw_only=True)
class Causes(job.Study):
    """Banks of SVSFs with one possible cause of their probabilities changed."""

    method: Literal["causes"]
    scales: Annotated[Changed, PURE]


@dataclass(frozen=True, kw_only=True)
class Frozen(job.Study):
    """Banks of SVSFs, and of filters with random gains, with their gains frozen."""

    method: Literal["frozen"]


Study = Neighbourhood | Changes | Causes | Frozen


@dataclass(frozen=True)
class Metrics:
    """Windows and levels of the metrics."""

    before: Span
    after: Span
    overshoot: Span
    alarm: Annotated[Share, PURE]
    band: Annotated[Share, PURE]


@dataclass(frozen=True)
class Theory:
    """The setting of the theory's numbers."""

    observers: Names
    period: Duration
    input: TestInput
    horizon: Duration
    onset: Duration
    switching_condition: SwitchingCondition
    layer_share: Annotated[Share, PURE]


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


Job = job.Job[Plant, Scenario, Observer, Metrics, Figure, Theory, Study, None, Search]
Parameters = job.sections(Job)
