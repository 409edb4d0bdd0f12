"""The keys of the parameter file, as types."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from reobserve.core.errors import InputError, shown
from reobserve.core.validation import (
    Count,
    Names,
    Positive,
    Seed,
    Terms,
    Window,
    checked,
    items,
    parse,
    vector,
    within,
)
from reobserve_papers.parameters import job

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


# Lists of terms, which remain lists of mappings.
Polynomial = Annotated[
    Terms, items(), checked(lambda place, value: parse(list[Monomial], value, place))
]
Printed = Annotated[
    Terms, items(), checked(lambda place, value: parse(list[PrintedCoefficient], value, place))
]
Order = Annotated[int, within(0, MOST_DEGREE)]
Orders = Annotated[list[Order], items()]
Degree = Annotated[int, within(1, MOST_DEGREE)]
State = Annotated[list[float], items()]
Gain = Literal["series", "jacobian", "composed"]


@dataclass(frozen=True)
class Plant:
    """An autonomous polynomial system, and the record of it."""

    dynamics: Polynomial
    output: Polynomial
    horizon: Positive
    step: Positive

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

    injection: Polynomial
    degree: Degree
    title: str = ""


@dataclass(frozen=True)
class Identity:
    """An observer in the plant's own coordinates."""

    algorithm: Literal["identity"]
    design: str
    order: Order
    gain: Gain
    initial_estimate: State
    sampling_period: Positive
    label: str = ""


@dataclass(frozen=True)
class Transformed:
    """An observer in the coordinates of the normal form."""

    algorithm: Literal["transformed"]
    design: str
    order: Order
    initial_estimate: State
    sampling_period: Positive
    label: str = ""


Observer = Identity | Transformed


@dataclass(frozen=True)
class OrdersStudy:
    """Errors of the identity form over order and gain, and its Floquet exponents."""

    method: Literal["orders"]
    scenario: str
    design: str
    observers: Names
    orders: Orders
    settle: Positive
    cycle_points: Annotated[int, within(100, 100_000)]
    title: str = ""


@dataclass(frozen=True)
class EnsembleStudy:
    """Every order compared with the constant gain over a grid of initial states."""

    method: Literal["ensemble"]
    scenario: str
    design: str
    observers: Names
    orders: Orders
    half_width: Positive
    points: Annotated[int, within(2, 1000)]
    sampling_period: Positive
    title: str = ""


@dataclass(frozen=True)
class DomainStudy:
    """Domains where the series converge, and their errors on the limit cycle."""

    method: Literal["domain"]
    scenario: str
    design: str
    observers: Names
    degree: Annotated[int, within(LEAST_DEGREE, MOST_DEGREE)]
    settle: Positive
    cycle_points: Annotated[int, within(10, 100_000)]
    title: str = ""


@dataclass(frozen=True)
class InjectionsStudy:
    """Injections with a cubic term compared with the constant gain, by their coefficients."""

    method: Literal["injections"]
    scenario: str
    design: str
    observers: Names
    largest: Positive
    coefficients: Annotated[int, within(2, 101)]
    half_width: Positive
    points: Annotated[int, within(2, 1000)]
    sampling_period: Positive
    title: str = ""


Study = OrdersStudy | EnsembleStudy | DomainStudy | InjectionsStudy


@dataclass(frozen=True)
class Table:
    """Printed coefficients, for comparison with the exact ones."""

    design: str
    printed: Printed
    degree: Degree
    title: str = ""
    source: str = ""


@dataclass(frozen=True)
class Metrics:
    """Parameters of the metrics."""

    settling_band: Positive
    decay_window: Window


@dataclass(frozen=True)
class Theory:
    """Parameters of the theory."""

    printed: Printed
    printed_degree: Annotated[int, within(2, MOST_DEGREE)]
    degree: Annotated[int, within(2, MOST_DEGREE)]
    seed: Seed
    cases: Annotated[int, within(1, 10_000)]
    case_degree: Annotated[int, within(3, MOST_DEGREE)]
    case_terms: Annotated[int, within(2, 10)]
    initial_state: State
    printed_eigenvalue: Annotated[list[float], vector(2)]
    near_share: Positive
    near_duration: Positive
    series_degree: Annotated[int, within(LEAST_DEGREE, MOST_DEGREE)]
    decay_start: Positive
    decay_duration: Positive
    spectrum_degree: Annotated[int, within(2, MOST_DEGREE)]
    siegel_dynamics: Polynomial
    siegel_injection: Polynomial
    poles: Annotated[list[float], vector(2)]
    choices: Count
    tries: Annotated[int, within(1, 1000)]
    margin: Positive
    lie_gain: Literal["eliminated", "open"]
    brute_force: Literal["by_degree", "all_at_once"]
    compared_order: Order
    compared_gain: Gain
    compared_error: Literal["x", "x1", "x2"]
    compared_half_width: Positive
    compared_points: Annotated[int, within(2, 1000)]
    compared_duration: Positive
    compared_band: Positive
    compared_period: Positive


@dataclass(frozen=True, kw_only=True)
class Responses(job.Figure):
    """Errors over time."""

    layout: Literal["errors", "forms"]
    study: str
    shown: Positive


@dataclass(frozen=True, kw_only=True)
class OfStudy(job.StudyFigure):
    """A study."""

    layout: Literal["orders", "ensemble", "domain"]


@dataclass(frozen=True, kw_only=True)
class OfInjections(job.StudyFigure):
    """A study of injections, and errors over time."""

    layout: Literal["injections"]
    shown: Positive


Figure = Responses | OfStudy | OfInjections


@dataclass(frozen=True)
class Parameters:
    """All sections."""

    plant: Plant
    scenarios: Mapping[str, Scenario]
    designs: Mapping[str, InjectionDesign]
    observers: Mapping[str, Annotated[Observer, Field(discriminator="algorithm")]]
    studies: Mapping[str, Annotated[Study, Field(discriminator="method")]]
    tables: Mapping[str, Table]
    metrics: Metrics
    theory: Theory
    figures: Mapping[str, Annotated[Figure, Field(discriminator="layout")]]


Job = job.Job[
    Plant, Scenario, Observer, Metrics, Figure, Theory, Study, InjectionDesign, None, Table
]
