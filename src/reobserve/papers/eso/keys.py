"""The keys of the ledger, as types."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from reobserve.errors import InputError
from reobserve.ledger import types
from reobserve.ledger.conditions import (
    Count,
    Levels,
    NotNegative,
    Positive,
    Terms,
    Window,
    array,
    items,
    signal,
    vector,
)
from reobserve.numerics.matrices import as_floats

Fault = Annotated[Terms, signal(1)]
Pair = Annotated[list[float], vector(2)]
Poles = Annotated[list[float], vector(3)]
Column = Annotated[Any, array(2, 1)]
Changed = Annotated[list[Positive], items(0)]  # values to try, or none
Solver = Literal["CLARABEL", "SCS"]


def ranges(place: str, value: Any) -> None:
    """Ranges of both disturbances, one pair a reading."""
    shape = as_floats(place, value).shape
    if len(shape) != 3 or shape[0] == 0 or shape[1:] != (2, 2):
        raise InputError(place, f"has shape {shape}, must be (k, 2, 2): ranges of d1 and d2")


@dataclass(frozen=True)
class Plant:
    """The motor, its speed control, what disturbs it, and the record."""

    inertia: Positive
    friction: Positive
    torque_constant: Positive
    emf_constant: Positive
    resistance: Positive
    inductance: Positive
    controller_poles: Poles
    reference: Fault
    disturbance_matrix: Annotated[Any, array(2, 2)]
    noise_matrix: Column
    sensor_matrix: Column
    horizon: Positive
    step: Positive
    hold_period: Positive


@dataclass(frozen=True)
class Scenario:
    """Faults, disturbances and noise."""

    actuator_fault: Fault
    sensor_fault: Fault
    disturbance_low: Pair
    disturbance_high: Pair
    noise_power: NotNegative
    title: str = ""


@dataclass(frozen=True)
class Feasible:
    """Gains by feasibility with a decay rate."""

    kind: Literal["pi_feasible"]
    filter_rate: Positive
    decay: NotNegative
    solver: Solver
    title: str = ""


@dataclass(frozen=True)
class LeastNorm:
    """Gains by optimisation, gamma fixed at a multiple of its floor."""

    kind: Literal["pi_least_norm", "pd_pi_least_norm"]
    filter_rate: Positive
    factor: Positive  # of gamma over its floor
    solver: Solver
    title: str = ""


@dataclass(frozen=True)
class Bounded:
    """Theorem 1, min gamma, with poles not faster than a bound and matrices in a radius."""

    kind: Literal["pd_pi_bounded"]
    filter_rate: Positive
    pole_bound: Positive
    radius: Positive
    solver: Solver
    title: str = ""


Design = Feasible | LeastNorm | Bounded


@dataclass(frozen=True)
class Observer:
    """An extended state observer with the gains of a design."""

    algorithm: Literal["extended_state"]
    design: str
    label: str = ""


@dataclass(frozen=True, kw_only=True)
class Designs(types.Study):
    """The study of many designs."""

    method: Literal["designs"]
    observers: list[str]  # none: it has designs of its own
    filter_rates: Changed
    decays: Annotated[list[NotNegative], items(0)]
    factors: Changed
    pole_bounds: Changed
    radius: Positive
    solver: Solver


@dataclass(frozen=True)
class Metrics:
    """How estimates are judged."""

    actuator_varying: Window
    actuator_constant: Window
    sensor_varying: Window
    sensor_constant: Window
    longest_lag: Positive


@dataclass(frozen=True)
class Theory:
    """What the numbers of the theory are computed for."""

    cases: Count
    excess: Positive
    filter_rates: Levels
    fault_frequencies: Annotated[Levels, vector(2)]
    fast_fault: Positive
    noise_power: Positive
    readings: Annotated[Any, ranges]
    other_poles: Poles


@dataclass(frozen=True, kw_only=True)
class Faults(types.Figure):
    """One fault and its estimates."""

    layout: Literal["actuator", "sensor"]


@dataclass(frozen=True, kw_only=True)
class DesignsFigure(types.StudyFigure):
    """The study."""

    layout: Literal["designs"]


@dataclass(frozen=True)
class Ledger:
    """All sections."""

    plant: Plant
    scenarios: Mapping[str, Scenario]
    designs: Mapping[str, Design]
    observers: Mapping[str, Observer]
    studies: Mapping[str, Designs]
    metrics: Metrics
    theory: Theory
    figures: Mapping[str, Faults | DesignsFigure]
