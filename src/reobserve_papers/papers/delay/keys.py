"""The keys of the parameter file, as types."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple

from reobserve.core.errors import InputError, shown
from reobserve.core.matrices import as_floats
from reobserve.core.validation import (
    Count,
    Levels,
    MatrixValue,
    NotNegative,
    Positive,
    Terms,
    as_stated,
    items,
    vector,
    within,
)
from reobserve_papers.parameters import job
from reobserve_papers.parameters.job import signal
from reobserve_papers.parameters.units import PER_SECOND, PURE, TIMING, Duration, Span, Unit, UnitBy

MAX_DERIVATIVES = 2  # of u, in a plant's record and by the differentiator (37)

Scalar = Annotated[Terms, signal(1)]
Model = Literal["pendulum", "lag"]


def of_models(pendulum: str, lag: str) -> UnitBy:
    """The unit of a key that depends on the model."""
    return UnitBy("model", {"pendulum": Unit(pendulum), "lag": Unit(lag)})


State = Annotated[list[float], items(1, 2), of_models("rad, rad/s", "1")]
TORQUE = Unit("N m", beside=("N m/s", *TIMING))
INPUT = UnitBy("model", {"pendulum": TORQUE, "lag": Unit("1", beside=("1/s", *TIMING))})
Torque = Annotated[Scalar, TORQUE]


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

    gravity: Annotated[Positive, Unit("m/s^2")]
    length: Annotated[Positive, Unit("m")]
    mass: Annotated[Positive, Unit("kg")]
    friction: Annotated[NotNegative, Unit("kg/s")]
    delay: Annotated[Scalar, Unit("s", beside=("1", *TIMING))]
    delay_bounds: Span
    horizon: Duration
    step: Duration
    noise_period: Duration
    noise_size: Literal["deviation", "peak"]
    noise_peak: Annotated[Positive, PURE]
    noise_amplitude: Literal["swing", "wrapped", "turns"]
    swing: Annotated[Positive, Unit("rad")]
    noisy_input: Literal["measured", "applied"]


@dataclass(frozen=True)
class Scenario:
    """A system, its input and the noise, as a share of the amplitudes of y and u."""

    model: Model
    initial_state: State
    input: Annotated[Scalar, INPUT]
    past: Literal["continued", "zero"]
    noise_share: Annotated[NotNegative, PURE]
    title: str = ""


class Levant(NamedTuple):
    """The parameters of the differentiator (37)."""

    L: float
    sampling: float
    lambdas: list[float]


@dataclass(frozen=True)
class Extended(job.Observer):
    """The extended observer, with exact derivatives of the input or the differentiator (37)."""

    algorithm: Literal["extended"]
    model: Model
    order: Annotated[int, within(1, MAX_DERIVATIVES), PURE]
    rho: Annotated[Positive, PER_SECOND]
    initial_estimate: State
    initial_delay: Annotated[float, Unit("s")]
    initial_matrix: Annotated[InitialMatrix, as_stated(initial_matrix), Unit("1", "word")]
    threshold: Annotated[NotNegative, of_models("N/(kg m s)", "1/s")]
    switched: Literal["delay", "all"]
    derivatives: Literal["exact", "levant"]
    lambdas: Annotated[Levels, vector(3), PURE] | None = None
    L: Annotated[Positive, of_models("N m/s^3", "1/s^3")] | None = None
    sampling: Duration | None = None
    initial_derivatives: Literal["zero", "exact"] = "zero"

    def levant(self) -> Levant:
        """The differentiator's parameters, or `InputError` with the one that is missing."""
        for name in Levant._fields:
            if getattr(self, name) is None:
                raise InputError(name, "is missing; derivatives by levant need it")
        return Levant(*(getattr(self, name) for name in Levant._fields))


@dataclass(frozen=True)
class Standard(job.Observer):
    """The high-gain observer with a constant delay."""

    algorithm: Literal["standard"]
    model: Model
    rho: Annotated[Positive, PER_SECOND]
    mean_delay: Duration
    initial_estimate: State


@dataclass(frozen=True)
class LeastSquares(job.Observer):
    """Least squares, a reconstruction."""

    algorithm: Literal["least_squares"]
    initial_covariance: Annotated[Positive, PURE]
    forgetting: Annotated[NotNegative, PER_SECOND]
    initial_delay: Annotated[float, Unit("s")]


@dataclass(frozen=True)
class AdaptiveIdentification(job.Observer):
    """Adaptive identification, a reconstruction."""

    algorithm: Literal["adaptive"]
    filter_time: Duration
    forgetting: Annotated[Positive, PER_SECOND]
    adaptation_gain: Annotated[Positive, PURE]
    initial_delay: Annotated[float, Unit("s")]


@dataclass(frozen=True)
class Relay(job.Observer):
    """A variable structure, a reconstruction."""

    algorithm: Literal["relay"]
    relay_gain: Annotated[Positive, Unit("1/s^2")]
    relay_on: Literal["delay", "inverse"]
    initial_delay: Annotated[float, Unit("s")]


HighGain = Extended | Standard
Estimator = LeastSquares | AdaptiveIdentification | Relay
Observer = Extended | Standard | LeastSquares | AdaptiveIdentification | Relay


@dataclass(frozen=True, kw_only=True)
class Tradeoff(job.Study):
    """The error of the delay against rho, without and with noise."""

    method: Literal["tradeoff"]
    rhos: Annotated[Levels, PER_SECOND]
    runs: Annotated[int, within(1, 100_000), PURE]
    sampling_period: Duration


@dataclass(frozen=True, kw_only=True)
class Tuning(job.Study):
    """Errors of the four methods of Fig. 3 against the tuning of each."""

    method: Literal["tuning"]
    rhos: Annotated[Levels, PER_SECOND]
    forgetting: Annotated[Levels, PER_SECOND]
    relay_gains: Annotated[Levels, Unit("1/s^2")]


Study = Tradeoff | Tuning


@dataclass(frozen=True)
class Metrics:
    """The windows for errors."""

    start: Annotated[NotNegative, Unit("s")]
    late: Duration
    ripple: Duration
    varying_from: Annotated[NotNegative, Unit("s")]
    varying_until: Duration
    radius: Span


@dataclass(frozen=True)
class Theory:
    """Settings of the theory stage."""

    ramp: Torque
    sine: Torque
    initial_state: Annotated[list[float], items(1, 2), Unit("rad, rad/s")]
    noise_share: Annotated[NotNegative, PURE]
    small_threshold: Annotated[Positive, Unit("N/(kg m s)")]
    rhos: Annotated[Levels, PER_SECOND]
    faster: Annotated[Positive, PURE]
    gain_of_rate: Annotated[NotNegative, PURE]
    sampling_period: Duration
    cases: Annotated[Count, PURE]


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


Job = job.Job[Plant, Scenario, Observer, Metrics, Figure, Theory, Study]
Parameters = job.sections(Job)
