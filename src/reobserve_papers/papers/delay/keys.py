"""The keys of the parameter file, as types."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field

from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_floats
from reobserve.core.validation import (
    Count,
    Levels,
    MatrixValue,
    NotNegative,
    Positive,
    Terms,
    Window,
    as_stated,
    items,
    rising,
    vector,
    within,
)
from reobserve_papers.parameters import job
from reobserve_papers.parameters.job import signal

MAX_DERIVATIVES = 2  # of u, in a plant's record and by the differentiator (37)

Scalar = Annotated[Terms, signal(1)]
State = Annotated[list[float], items(1, 2)]
Model = Literal["pendulum", "lag"]


# Text is `algebraic`.
InitialMatrix = MatrixValue | str


def initial_matrix(place: str, value: Any) -> None:
    """Check S_0: a number, a matrix, or `algebraic` for the solution of the algebraic equation."""
    if isinstance(value, str):
        if value != "algebraic":
            raise InputError(place, f"{shown(value)} must be algebraic, a number or a matrix")
    else:
        as_floats(place, value)


@dataclass(frozen=True)
class Plant:
    """The pendulum, the delay of its input, and the record."""

    gravity: Positive
    length: Positive
    mass: Positive
    friction: NotNegative
    delay: Scalar
    delay_bounds: Annotated[list[float], rising]
    horizon: Positive
    step: Positive
    noise_period: Positive
    noise_size: Literal["deviation", "peak"]
    noise_peak: Positive
    noise_amplitude: Literal["swing", "wrapped", "turns"]
    swing: Positive
    noisy_input: Literal["measured", "applied"]


@dataclass(frozen=True)
class Scenario:
    """A system, its input and the noise, as a share of the amplitudes of y and u."""

    model: Model
    initial_state: State
    input: Scalar
    past: Literal["continued", "zero"]
    noise_share: NotNegative
    title: str = ""


class Levant(NamedTuple):
    """The parameters of the differentiator (37)."""

    L: float
    sampling: float
    lambdas: list[float]


@dataclass(frozen=True)
class Extended:
    """The extended observer, with exact derivatives of the input or the differentiator (37)."""

    algorithm: Literal["extended"]
    model: Model
    order: Annotated[int, within(1, MAX_DERIVATIVES)]
    rho: Positive
    initial_estimate: State
    initial_delay: float
    initial_matrix: Annotated[InitialMatrix, as_stated(initial_matrix)]
    threshold: NotNegative
    switched: Literal["delay", "all"]
    derivatives: Literal["exact", "levant"]
    sampling_period: Positive
    lambdas: Annotated[Levels, vector(3)] | None = None
    L: Positive | None = None
    sampling: Positive | None = None
    initial_derivatives: Literal["zero", "exact"] = "zero"
    label: str = ""

    def levant(self) -> Levant:
        """The differentiator's parameters, or `InputError` with the one that is missing."""
        for name in Levant._fields:
            if getattr(self, name) is None:
                raise InputError(name, "is missing; derivatives by levant need it")
        return Levant(*(getattr(self, name) for name in Levant._fields))


@dataclass(frozen=True)
class Standard:
    """The high-gain observer with a constant delay."""

    algorithm: Literal["standard"]
    model: Model
    rho: Positive
    mean_delay: Positive
    initial_estimate: State
    sampling_period: Positive
    label: str = ""


@dataclass(frozen=True)
class LeastSquares:
    """Least squares, a reconstruction."""

    algorithm: Literal["least_squares"]
    initial_covariance: Positive
    forgetting: NotNegative
    initial_delay: float
    sampling_period: Positive
    label: str = ""


@dataclass(frozen=True)
class AdaptiveIdentification:
    """Adaptive identification, a reconstruction."""

    algorithm: Literal["adaptive"]
    filter_time: Positive
    forgetting: Positive
    adaptation_gain: Positive
    initial_delay: float
    sampling_period: Positive
    label: str = ""


@dataclass(frozen=True)
class Relay:
    """A variable structure, a reconstruction."""

    algorithm: Literal["relay"]
    relay_gain: Positive
    relay_on: Literal["delay", "inverse"]
    initial_delay: float
    sampling_period: Positive
    label: str = ""


HighGain = Extended | Standard
Estimator = LeastSquares | AdaptiveIdentification | Relay
Observer = Extended | Standard | LeastSquares | AdaptiveIdentification | Relay


@dataclass(frozen=True, kw_only=True)
class Tradeoff(job.Study):
    """The error of the delay against rho, without and with noise."""

    method: Literal["tradeoff"]
    rhos: Levels
    runs: Annotated[int, within(1, 100_000)]
    sampling_period: Positive


@dataclass(frozen=True, kw_only=True)
class Tuning(job.Study):
    """Errors of the four methods of Fig. 3 against the tuning of each."""

    method: Literal["tuning"]
    rhos: Levels
    forgetting: Levels
    relay_gains: Levels


Study = Tradeoff | Tuning


@dataclass(frozen=True)
class Metrics:
    """The windows for errors."""

    start: NotNegative
    late: Positive
    ripple: Positive
    varying_from: NotNegative
    varying_until: Positive
    radius: Window


@dataclass(frozen=True)
class Theory:
    """Settings of the theory stage."""

    ramp: Scalar
    sine: Scalar
    initial_state: State
    noise_share: NotNegative
    small_threshold: Positive
    rhos: Levels
    faster: Positive
    gain_of_rate: NotNegative
    sampling_period: Positive
    cases: Count


@dataclass(frozen=True, kw_only=True)
class DelayFigure(job.Figure):
    """Delay and states of one scenario."""

    layout: Literal["states", "comparison"]


@dataclass(frozen=True, kw_only=True)
class TradeoffFigure(job.StudyFigure):
    """A figure of the study of the gain."""

    layout: Literal["tradeoff"]


@dataclass(frozen=True, kw_only=True)
class TuningFigure(job.StudyFigure):
    """A figure of the study of all methods."""

    layout: Literal["tuning"]


Figure = DelayFigure | TradeoffFigure | TuningFigure


@dataclass(frozen=True)
class Parameters:
    """All sections."""

    plant: Plant
    scenarios: Mapping[str, Scenario]
    observers: Mapping[str, Annotated[Observer, Field(discriminator="algorithm")]]
    studies: Mapping[str, Annotated[Study, Field(discriminator="method")]]
    metrics: Metrics
    theory: Theory
    figures: Mapping[str, Annotated[Figure, Field(discriminator="layout")]]


Job = job.Job[Plant, Scenario, Observer, Metrics, Figure, Theory, Study]
