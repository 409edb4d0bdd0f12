"""A two-mass oscillator: a Luenberger observer against the steady Kalman filter.

    m1 x1'' = -k (x1 - x2) - c (x1' - x2') + u,    m2 x2'' = k (x1 - x2) + c (x1' - x2') + d

x1 is measured, the force u is known, gusts d are not; x2 is what is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

from reobserve.core.discretisation import zero_order_hold
from reobserve.core.files import NAME, NUMBER
from reobserve.core.matrices import Matrix
from reobserve.core.random_streams import random_stream
from reobserve.core.validation import Levels, NotNegative, Positive, vector
from reobserve.observers.fixed_gain import luenberger, steady_kalman
from reobserve.systems.linear import LinearModel
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.responses import root_mean_square
from reobserve_papers.parameters import job
from reobserve_papers.parameters.check import Checks
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.parameters.job import AnyFigure, Study
from reobserve_papers.plotting.figures import STYLES, new_figure, time_axis
from reobserve_papers.signals.series import Channel, Series


@dataclass(frozen=True)
class Plant:
    """Two masses, a spring and a damper, and what moves them."""

    masses: Annotated[list[Positive], vector(2)]
    stiffness: Positive
    damping: NotNegative
    force: Positive
    force_period: Positive
    gusts: Positive
    horizon: Positive
    step: Positive


@dataclass(frozen=True)
class Scenario:
    """The standard deviation of the sensor's noise."""

    noise: Positive
    title: str = ""


@dataclass(frozen=True)
class Design:
    """The place of all poles of the error."""

    pole: Positive
    title: str = ""


@dataclass(frozen=True)
class Observer:
    """The poles of a design, or the Kalman filter for a noise."""

    algorithm: Literal["luenberger", "kalman"]
    label: str = ""
    design: str = ""
    noise: Positive = 1.0


@dataclass(frozen=True, kw_only=True)
class NoiseStudy(Study):
    """Errors over the sensor's noise."""

    design: str
    noises: Levels


@dataclass(frozen=True)
class Metrics:
    """The time from which errors count."""

    settled: Positive


@dataclass(frozen=True)
class Parameters:
    """All sections."""

    plant: Plant
    scenarios: Mapping[str, Scenario]
    designs: Mapping[str, Design]
    observers: Mapping[str, Observer]
    studies: Mapping[str, NoiseStudy]
    metrics: Metrics
    figures: Mapping[str, AnyFigure]


Job = job.Job[Plant, Scenario, Observer, Metrics, AnyFigure, None, NoiseStudy, Design]


def sampled(plant: Plant, sign: float = 1.0) -> tuple[Matrix, Matrix]:
    """A and the effects of u and d over a step, where ``sign`` is that of the damper in (2)."""
    (m1, m2), k, c = plant.masses, plant.stiffness, plant.damping
    forces = [[-k, k, -c, c], [k, -k, sign * c, -sign * c]]
    inverse = np.diag([1 / m1, 1 / m2])
    A = np.vstack([np.eye(4)[2:], inverse @ forces])
    return zero_order_hold(A, np.vstack([np.zeros((2, 2)), inverse]), plant.step)


def simulate(job: Job) -> Series:
    """Simulate from rest, under a square wave of force and gusts that are new at every step."""
    plant, (A, effects) = job.plant, sampled(job.plant)
    rows = np.arange(round(plant.horizon / plant.step) + 1, dtype=np.float64)
    time = rows * plant.step
    force = np.where(time % plant.force_period < plant.force_period / 2, plant.force, -plant.force)
    gusts, noise = random_stream(job.seed, "two_mass").normal(size=(2, len(time)))
    state = np.zeros((len(time), 4))
    for row, both in enumerate(np.column_stack([force, plant.gusts * gusts])[:-1]):
        state[row + 1] = A @ state[row] + effects @ both
    x = {"position": Channel(state[:, :2], "m"), "force": Channel(force, "N")}
    return Series(time, {**x, "measured": Channel(state[:, 0] + job.scenario.noise * noise, "m")})


def compute(job: Job) -> dict[str, Any]:
    """A design: where the error's poles lie after a step."""
    return {"poles": [float(np.exp(-job.design.pole * job.plant.step))] * 4}


def observed(plant: Plant, poles: Any, noise: float, y: Matrix, u: Matrix) -> Matrix:
    """x1 and x2 [m] by an observer with these poles, or without any by the Kalman filter."""
    A, effects = sampled(plant)
    gust, C = plant.gusts * effects[:, 1:], [[1.0, 0.0, 0.0, 0.0]]
    Q, R = gust @ gust.T, noise**2
    model = LinearModel(A, effects[:, :1], C, Q=Q, R=R, sampling_period=plant.step)
    built = luenberger(model, poles) if poles else steady_kalman(model)
    return built.run(y, u, state=built.init(np.zeros(4), 0.0))["state"][:, :2]


def estimate(job: Job, record: Series, design: Mapping[str, Any] | None = None) -> Series:
    """One observer on a record."""
    poles, signals = design["poles"] if design else None, (record["measured"], record["force"])
    found = observed(job.plant, poles, job.observer.noise, *signals)
    return Series(record.time, {"position": Channel(found, "m")})


KINDS = {"observer": NAME, "noise": NUMBER, "rms_error": NUMBER}
HEADER = tuple(KINDS)
MEANINGS = {
    "rms_error": "root mean square error of x2 once it has settled",
    "rms_error noise=<noise>": "the same with another noise, which the Kalman filter is given",
}


def rms_error(job: Job, record: Series, found: Matrix) -> float:
    """The RMS error of x2 [m]."""
    settled = record.time >= job.metrics.settled
    return float(root_mean_square((found - record["position"])[settled, 1]))


def run(job: Job, record: Series, design: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The study: both observers on the same motion, more or less finely measured."""
    rows: list[dict[str, Any]] = []
    x1, noise = record["position"][:, 0], record["measured"] - record["position"][:, 0]
    for level in job.study.noises:
        measured = x1 + level / job.scenario.noise * noise
        for name, stated in job.observers.items():
            poles = design["poles"] if stated.design else None
            found = observed(job.plant, poles, level, measured, record["force"])
            rows.append(dict(zip(KINDS, (name, level, rms_error(job, record, found)), strict=True)))
    return rows


def measure(data: FigureData[Job]) -> Iterator[Metric]:
    """RMS errors, over noise where the figure has a study."""
    for name, found in data.estimates.items():
        yield Metric(name, "rms_error", rms_error(data.job, data.plant, found["position"]), "m")
    for (name, level), rows in data.study.groups("observer", "noise") if data.study else ():
        yield Metric.at(name, ("rms_error", rows.value("rms_error"), "m"), noise=level)


def errors(data: FigureData[Job]) -> Any:
    """The errors of x2 over time."""
    figure, (axes,) = new_figure((2.2,))
    for style, (name, found) in zip(STYLES, data.estimates.items(), strict=False):
        error = (found["position"] - data.plant["position"])[:, 1]
        axes.plot(found.time, error, **style.line(), label=data.job.observers[name].label)
    axes.set_ylabel("error of x₂ [m]")
    axes.legend(ncols=2)
    time_axis(axes, data.plant.time)
    return figure


def over_noise(data: FigureData[Job]) -> Any:
    """The error of x2 over the deviation of the noise."""
    figure, (axes,) = new_figure((2.4,))
    for style, ((name,), rows) in zip(STYLES, data.study.groups("observer"), strict=False):
        label = data.job.observers[name].label
        axes.loglog(rows["noise"], rows["rms_error"], **style.points(), label=label)
    axes.set_xlabel("standard deviation of the sensor's noise [m]")
    axes.set_ylabel("RMS error of x₂ [m]")
    axes.legend()
    return figure


LAYOUTS = {"errors": errors, "noises": over_noise}
CHECKS = Checks(build={"design": compute})
