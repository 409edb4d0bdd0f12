"""A two-mass oscillator: a Luenberger observer against the steady Kalman filter.

    m1 x1'' = -k (x1 - x2) - c (x1' - x2') + u,    m2 x2'' = k (x1 - x2) + c (x1' - x2') + d

x1 is measured, the force u is known, gusts d are not; x2 is what is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

from reobserve import LinearModel, luenberger, steady_kalman
from reobserve.core.discretisation import zero_order_hold
from reobserve.core.matrices import Matrix
from reobserve.core.validation import NotNegative, Positive, vector
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.responses import root_mean_square
from reobserve_papers.parameters import job
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.parameters.job import AnyFigure
from reobserve_papers.parameters.units import Duration, Unit
from reobserve_papers.plotting.figures import STYLES, headroom, new_figure, time_axis
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Channel, Series

# The keys of the parameter file, a class for a section.


@dataclass(frozen=True)
class Plant:
    """Two masses, a spring and a damper, and what moves them."""

    masses: Annotated[list[Positive], vector(2), Unit("kg")]
    stiffness: Annotated[Positive, Unit("N/m")]
    damping: Annotated[NotNegative, Unit("N s/m")]
    force: Annotated[Positive, Unit("N")]
    force_period: Duration
    gusts: Annotated[Positive, Unit("N")]
    horizon: Duration
    step: Duration


@dataclass(frozen=True)
class Scenario:
    """The standard deviation of the sensor's noise."""

    noise: Annotated[Positive, Unit("m")]
    title: str = ""


@dataclass(frozen=True)
class Observer:
    """The place of all poles of the error, or the noise for which the Kalman filter is optimal."""

    algorithm: Literal["luenberger", "kalman"]
    label: str = ""
    pole: Annotated[Positive, Unit("1/s")] = 1.0
    noise: Annotated[Positive, Unit("m")] = 1.0


@dataclass(frozen=True)
class Metrics:
    """The time from which errors count."""

    settled: Duration


@dataclass(frozen=True)
class Parameters:
    """All sections."""

    plant: Plant
    scenarios: Mapping[str, Scenario]
    observers: Mapping[str, Observer]
    metrics: Metrics
    figures: Mapping[str, AnyFigure]


Job = job.Job[Plant, Scenario, Observer, Metrics, AnyFigure]


# The steps, each called by a rule of its own.


def simulate(job: Job) -> Series:
    """Simulate from rest, under a square wave of force and gusts that are new at every step."""
    plant, (A, effects) = job.plant, sampled(job.plant)
    time = np.arange(round(plant.horizon / plant.step) + 1, dtype=np.float64) * plant.step
    force = np.where(time % plant.force_period < plant.force_period / 2, plant.force, -plant.force)
    gusts, noise = random_stream(job.seed, "gusts and noise").normal(size=(2, len(time)))
    state = np.zeros((len(time), 4))
    for row, both in enumerate(np.column_stack([force, plant.gusts * gusts])[:-1]):
        state[row + 1] = A @ state[row] + effects @ both
    x = {"position": Channel(state[:, :2], "m"), "force": Channel(force, "N")}
    return Series(time, {**x, "measured": Channel(state[:, 0] + job.scenario.noise * noise, "m")})


def sampled(plant: Plant, sign: float = 1.0) -> tuple[Matrix, Matrix]:
    """A and the effects of u and d over a step, where ``sign`` is that of the damper in (2)."""
    (m1, m2), k, c = plant.masses, plant.stiffness, plant.damping
    forces = [[-k, k, -c, c], [k, -k, sign * c, -sign * c]]
    inverse = np.diag([1 / m1, 1 / m2])
    A = np.vstack([np.eye(4)[2:], inverse @ forces])
    return zero_order_hold(A, np.vstack([np.zeros((2, 2)), inverse]), plant.step)


def estimate(job: Job, record: Series) -> Series:
    """Run one observer on a record: x1 and x2 [m] from the measured x1 and the force."""
    plant, (A, effects) = job.plant, sampled(job.plant)
    gust, C = plant.gusts * effects[:, 1:], [[1.0, 0.0, 0.0, 0.0]]
    Q, R = gust @ gust.T, job.observer.noise**2
    model = LinearModel(A, effects[:, :1], C, Q=Q, R=R, sampling_period=plant.step)
    if job.observer.algorithm == "luenberger":
        built = luenberger(model, poles=[np.exp(-job.observer.pole * plant.step)] * 4)
    else:
        built = steady_kalman(model)
    run = built.run(record["measured"], record["force"], start=built.init(np.zeros(4), 0.0))
    return Series(record.time, {"position": Channel(run["state"][:, :2], "m")})


MEANINGS = {"rms_error": "root mean square error of x2 once it has settled"}
SUBJECTS: dict[str, str] = {}  # what else than observers metrics are of, by layout of a figure


def measure(data: FigureData[Job]) -> Iterator[Metric]:
    """Compute the RMS error of x2 of each observer."""
    settled = data.plant.time >= data.job.metrics.settled
    for name, found in data.estimates.items():
        error = (found["position"] - data.plant["position"])[settled, 1]
        yield Metric(name, "rms_error", float(root_mean_square(error)), "m")


def errors(data: FigureData[Job]) -> Any:
    """Draw the errors of x2 over time."""
    figure, (axes,) = new_figure((2.2,))
    for style, (name, found) in zip(STYLES, data.estimates.items(), strict=False):
        error = (found["position"] - data.plant["position"])[:, 1]
        axes.plot(found.time, error, **style.line(), label=data.job.observers[name].label)
    axes.set_ylabel("error of x₂ [m]")
    headroom(axes, 0.2)
    axes.legend(ncols=2, loc="upper left")
    time_axis(axes, data.plant.time)
    return figure


LAYOUTS = {"errors": errors}
