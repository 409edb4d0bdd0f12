"""The keys of the parameter file, as types."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from reobserve.core.errors import InputError, shown
from reobserve.core.validation import (
    Count,
    Positive,
    Seed,
    Terms,
    checked,
    items,
    parse,
    vector,
    within,
)
from reobserve_papers.parameters import job
from reobserve_papers.parameters.units import PER_SECOND, PURE, Duration, Span

MOST_DEGREE = 61  # of a series: two thousand monomials in two variables
LEAST_DEGREE = 13  # the degree from which on a radius of convergence is estimated

Power = Annotated[int, Field(ge=0)]


def decimal(place: str, text: str) -> None:
    """Refuse a text that is not a printed decimal number."""
    if not re.fullmatch(r"[-+]?[0-9]{1,40}(\.[0-9]{1,40})?", text):
        raise InputError(place, f"{shown(text)} must be the digits of a number")


@dataclass(frozen=True)
class Monomial:
    """A term of a polynomial map: its component, from 1, and the power of each variable."""

    component: Annotated[int, within(1, 100)]
    powers: Annotated[list[Power], items(1, 100)]
    coefficient: float | str  # a fraction such as 1/3 is a word


@dataclass(frozen=True)
class PrintedCoefficient:
    """A coefficient with the digits that the paper has."""

    component: Annotated[int, within(1, 100)]
    powers: Annotated[list[Power], items(1, 100)]
    text: Annotated[str, checked(decimal)]


# Lists of terms, which remain lists of mappings. The states have no units.
Polynomial = Annotated[
    Terms, items(), checked(lambda place, value: parse(list[Monomial], value, place))
]
Printed = Annotated[
    Terms, items(), checked(lambda place, value: parse(list[PrintedCoefficient], value, place))
]
Order = Annotated[int, within(0, MOST_DEGREE), PURE]
Orders = Annotated[list[Order], items()]
Degree = Annotated[int, within(1, MOST_DEGREE), PURE]
State = Annotated[list[float], items(), PURE]
Poles = Annotated[list[float], vector(2), PER_SECOND]
Factor = Annotated[Positive, PURE]
Gain = Literal["series", "jacobian", "composed"]


@dataclass(frozen=True)
class Plant:
    """An autonomous polynomial system, and the record of it."""

    dynamics: Annotated[Polynomial, PURE]
    output: Annotated[Polynomial, PURE]
    horizon: Duration
    step: Duration

    @property
    def states(self) -> int:
        """The number of states."""
        return len(self.dynamics[0]["powers"])

    @property
    def outputs(self) -> int:
        """The number of components of the output."""
        outputs: int = max(term["component"] for term in self.output)
        return outputs


@dataclass(frozen=True)
class Scenario:
    """The initial state of the plant."""

    initial_state: State
    title: str = ""


@dataclass(frozen=True)
class InjectionDesign:
    """A normal form, by its output injection."""

    injection: Annotated[Polynomial, PER_SECOND]
    degree: Degree
    title: str = ""


@dataclass(frozen=True)
class Identity(job.Observer):
    """An observer in the plant's own coordinates."""

    algorithm: Literal["identity"]
    design: str
    order: Order
    gain: Gain
    initial_estimate: State


@dataclass(frozen=True)
class Transformed(job.Observer):
    """An observer in the coordinates of the normal form."""

    algorithm: Literal["transformed"]
    design: str
    order: Order
    initial_estimate: State


Observer = Identity | Transformed


@dataclass(frozen=True, kw_only=True)
class _OfDesign(job.Study):
    design: str


@dataclass(frozen=True, kw_only=True)
class OrdersStudy(_OfDesign):
    """Errors of the identity form over order and gain, and its Floquet exponents."""

    method: Literal["orders"]
    orders: Orders
    settle: Duration
    cycle_points: Annotated[int, within(100, 100_000), PURE]


@dataclass(frozen=True, kw_only=True)
class EnsembleStudy(_OfDesign):
    """Every order compared with the constant gain over a grid of initial states."""

    method: Literal["ensemble"]
    orders: Orders
    half_width: Factor
    points: Annotated[int, within(2, 1000), PURE]
    sampling_period: Duration


@dataclass(frozen=True, kw_only=True)
class DomainStudy(_OfDesign):
    """Domains where the series converge, and their errors on the limit cycle."""

    method: Literal["domain"]
    degree: Annotated[int, within(LEAST_DEGREE, MOST_DEGREE), PURE]
    settle: Duration
    cycle_points: Annotated[int, within(10, 100_000), PURE]


@dataclass(frozen=True, kw_only=True)
class InjectionsStudy(_OfDesign):
    """Injections with a cubic term compared with the constant gain, by their coefficients."""

    method: Literal["injections"]
    largest: Annotated[Positive, PER_SECOND]
    coefficients: Annotated[int, within(2, 101), PURE]
    half_width: Factor
    points: Annotated[int, within(2, 1000), PURE]
    sampling_period: Duration


Study = OrdersStudy | EnsembleStudy | DomainStudy | InjectionsStudy


@dataclass(frozen=True)
class Table:
    """Printed coefficients, for comparison with the exact ones."""

    design: str
    printed: Annotated[Printed, PURE]
    degree: Degree
    title: str = ""
    source: str = ""


@dataclass(frozen=True)
class Metrics:
    """Parameters of the metrics."""

    settling_band: Factor
    decay_window: Span


@dataclass(frozen=True)
class Theory:
    """Parameters of the theory."""

    printed: Annotated[Printed, PURE]
    printed_degree: Annotated[int, within(2, MOST_DEGREE), PURE]
    degree: Annotated[int, within(2, MOST_DEGREE), PURE]
    seed: Annotated[Seed, PURE]
    cases: Annotated[int, within(1, 10_000), PURE]
    case_degree: Annotated[int, within(3, MOST_DEGREE), PURE]
    case_terms: Annotated[int, within(2, 10), PURE]
    initial_state: State
    printed_eigenvalue: Poles
    near_share: Factor
    near_duration: Duration
    series_degree: Annotated[int, within(LEAST_DEGREE, MOST_DEGREE), PURE]
    decay_start: Factor
    decay_duration: Duration
    spectrum_degree: Annotated[int, within(2, MOST_DEGREE), PURE]
    siegel_dynamics: Annotated[Polynomial, PURE]
    siegel_injection: Annotated[Polynomial, PER_SECOND]
    poles: Poles
    choices: Annotated[Count, PURE]
    tries: Annotated[int, within(1, 1000), PURE]
    margin: Factor
    lie_gain: Literal["eliminated", "open"]
    lie_equations: Literal["elimination", "division", "real_division"]
    brute_force: Literal["by_degree", "all_at_once"]
    compared_order: Order
    compared_gain: Gain
    compared_error: Literal["x", "x1", "x2"]
    compared_half_width: Factor
    compared_points: Annotated[int, within(2, 1000), PURE]
    compared_duration: Duration
    compared_band: Factor
    compared_period: Duration


@dataclass(frozen=True, kw_only=True)
class Responses(job.Figure):
    """Errors over time."""

    layout: Literal["errors", "forms"]
    study: str
    shown: Duration


@dataclass(frozen=True, kw_only=True)
class OfStudy(job.StudyFigure):
    """A study."""

    layout: Literal["orders", "ensemble", "domain"]


@dataclass(frozen=True, kw_only=True)
class OfInjections(job.StudyFigure):
    """A study of injections, and errors over time."""

    layout: Literal["injections"]
    shown: Duration


Figure = Responses | OfStudy | OfInjections


Job = job.Job[
    Plant, Scenario, Observer, Metrics, Figure, Theory, Study, InjectionDesign, None, Table
]
Parameters = job.sections(Job)
