"""The keys of the parameter file, as types."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from reobserve.core.validation import (
    NotNegative,
    Positive,
    Terms,
    array,
    distinct,
    items,
    vector,
)
from reobserve_papers.parameters import job
from reobserve_papers.parameters.job import signal
from reobserve_papers.parameters.units import PER_SECOND, PURE, TIMING, Duration, Span, Unit

Speed = Annotated[Terms, signal(1), Unit("rad/s", beside=("rad/s^2", *TIMING))]
Pair = Annotated[list[float], vector(2)]
Poles = Annotated[list[float], vector(3), PER_SECOND]
Column = Annotated[list[list[float]], array(2, 1), PURE]
Square = Annotated[list[list[float]], array(2, 2)]
Changed = Annotated[list[Positive], items(0)]  # values to try, or none
Disturbance = Annotated[Square, Unit("rad/s^2, A/s")]  # minimum and maximum of each
Solver = Literal["CLARABEL", "SCS"]
Criterion = Literal["minimum_norm", "minimum_gamma"]
Solution = Literal["minimum_norm", "positive", "largest_margin"]
Current = Literal["A", "mA"]


@dataclass(frozen=True)
class Plant:
    """The motor, its speed control, its disturbances, and the record."""

    inertia: Annotated[Positive, Unit("kg m^2")]
    friction: Annotated[Positive, Unit("N m s")]
    torque_constant: Annotated[Positive, Unit("N m/A")]
    emf_constant: Annotated[Positive, Unit("V s/rad")]
    resistance: Annotated[Positive, Unit("Ω")]
    inductance: Annotated[Positive, Unit("H")]
    controller_poles: Poles
    feedback: Literal["state", "output"]
    reference: Speed
    pulse_width: Duration
    initial_state: Annotated[Pair, Unit("rad/s, A")]
    disturbance_matrix: Annotated[Square, PURE]
    noise_matrix: Column
    sensor_matrix: Column
    horizon: Duration
    step: Duration
    hold_period: Duration

    def noise_deviation(self, power: float) -> float:
        """Standard deviation of the held samples of white noise of this power."""
        return float(np.sqrt(power / self.hold_period))


@dataclass(frozen=True)
class Scenario:
    """Faults, disturbances and noise."""

    actuator_fault: Annotated[Terms, signal(1), Unit("V", beside=("V/s", *TIMING))]
    sensor_fault: Speed
    disturbance: Disturbance
    noise_power: Annotated[NotNegative, Unit("(rad/s)^2 s")]
    title: str = ""


@dataclass(frozen=True)
class Feasible:
    """Gains by feasibility with a decay rate."""

    kind: Literal["pi_feasible"]
    filter_rate: Annotated[Positive, PER_SECOND]
    decay: Annotated[NotNegative, PER_SECOND]
    solution: Solution  # of the inequality, see `synthesis.extended_state.pi`
    solver: Solver
    current_unit: Current = "A"  # in which the solution is sought
    title: str = ""

    @property
    def name(self) -> str:
        """Name of the design in the study."""
        return self.kind if self.solution == "minimum_norm" else f"pi_{self.solution}"


@dataclass(frozen=True)
class Optimised:
    """Gains by optimisation, with one of two interpretations of "min gamma"."""

    kind: Literal["pi_optimised", "pd_pi_optimised"]
    filter_rate: Annotated[Positive, PER_SECOND]
    criterion: Criterion
    factor: Annotated[Positive, PURE]  # of gamma over its lower bound, for minimum_norm
    pole_bound: Annotated[Positive, PER_SECOND]  # for minimum_gamma, as the radius
    radius: Annotated[Positive, PURE]
    solver: Solver
    title: str = ""

    @property
    def name(self) -> str:
        """Name of the design in the study."""
        return f"{self.kind.removesuffix('_optimised')}_{self.criterion}"

    @property
    def level(self) -> float:
        """The level of the criterion that a study varies."""
        return self.factor if self.criterion == "minimum_norm" else self.pole_bound


Design = Feasible | Optimised


@dataclass(frozen=True)
class Observer:
    """An extended state observer with the gains of a design."""

    algorithm: Literal["extended_state"]
    design: str
    # x, xz, fa, fs
    initial_estimate: Annotated[list[float], vector(6), Unit("rad/s, A, rad/s, A, V, rad/s")]
    compared_with: str = ""  # the observer with which the estimates are compared
    label: str = ""


@dataclass(frozen=True, kw_only=True)
class Designs(job.Study):
    """The study of many designs."""

    method: Literal["designs"]
    observers: list[str]  # none: the study has its own designs
    filter_rates: Annotated[Changed, PER_SECOND]
    decays: Annotated[list[NotNegative], items(0), PER_SECOND]
    solutions: Annotated[list[Solution], distinct]  # one PI observer for each
    factors: Annotated[Changed, PURE]
    pole_bounds: Annotated[Changed, PER_SECOND]
    radius: Annotated[Positive, PURE]  # with these bounds
    radii: Annotated[Changed, PURE]  # with the first of them
    solver: Solver


@dataclass(frozen=True)
class Metrics:
    """Settings of the metrics."""

    actuator_varying: Span
    actuator_constant: Span
    sensor_varying: Span
    sensor_constant: Span
    longest_lag: Duration
    visible: Annotated[Positive, Unit("V, rad/s")]


@dataclass(frozen=True)
class Theory:
    """Settings of the numbers of the theory."""

    fast_frequency: Annotated[Positive, Unit("rad/s")]  # of a sinusoidal fault
    settled_after: Duration  # a jump
    disturbance: Disturbance
    noise_power: Annotated[Positive, Unit("(rad/s)^2 s")]


@dataclass(frozen=True, kw_only=True)
class Faults(job.Figure):
    """One fault and its estimates."""

    layout: Literal["actuator", "sensor"]


@dataclass(frozen=True, kw_only=True)
class DesignsFigure(job.StudyFigure):
    """The study."""

    layout: Literal["designs"]


Figure = Faults | DesignsFigure


Job = job.Job[Plant, Scenario, Observer, Metrics, Figure, Theory, Designs, Design]
Parameters = job.sections(Job)
