"""The keys of the parameter file, as types."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Literal

from reobserve.core.validation import Levels, Positive, vector
from reobserve_papers.parameters import job
from reobserve_papers.parameters.units import PER_SECOND, PURE, Duration, Unit

Pair = Annotated[list[float], vector(2), Unit("1/s, 1/s^2")]


@dataclass(frozen=True)
class Plant:
    rate: Annotated[Positive, PER_SECOND]
    horizon: Duration
    step: Duration


@dataclass(frozen=True)
class Scenario:
    disturbance: Annotated[float, PER_SECOND]
    title: str = ""


@dataclass(frozen=True)
class Design:
    pole: Annotated[Positive, PER_SECOND]
    title: str = ""


@dataclass(frozen=True)
class Observer:
    """Has its own gains, or those of a design."""

    algorithm: Literal["linear"]
    gains: Pair | None = None
    design: str = ""
    label: str = ""


@dataclass(frozen=True, kw_only=True)
class Study(job.Study):
    design: str
    factors: Annotated[Levels, PURE]


@dataclass(frozen=True)
class Theory:
    """Has no numbers of its own."""


@dataclass(frozen=True)
class Metrics:
    late_window: Duration


@dataclass(frozen=True)
class Table:
    design: str
    printed: Pair
    title: str = ""
    source: str = ""


@dataclass(frozen=True, kw_only=True)
class Figure(job.StudyFigure):
    layout: Literal["lines"]


@dataclass(frozen=True)
class Parameters:
    plant: Plant
    designs: Mapping[str, Design]
    scenarios: Mapping[str, Scenario]
    observers: Mapping[str, Observer]
    studies: Mapping[str, Study]
    theory: Theory
    metrics: Metrics
    tables: Mapping[str, Table]
    figures: Mapping[str, Figure]
