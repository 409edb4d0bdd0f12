"""A two-mass oscillator: a Luenberger observer against the steady Kalman filter.

    m1 x1'' = -k (x1 - x2) - c (x1' - x2') + u,    m2 x2'' = k (x1 - x2) + c (x1' - x2') + d

x1 is measured, the force u is known, gusts d are not; x2 is what is asked for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from reobserve.drawing.figures import STYLES, TRUTH, decades, new_figure, time_axis
from reobserve.ledger import types
from reobserve.ledger.check import Checks
from reobserve.ledger.conditions import Levels, NotNegative, Positive, vector
from reobserve.ledger.figure_data import FigureData
from reobserve.ledger.types import Job
from reobserve.models.linear import LinearModel
from reobserve.numerics.discretisation import zero_order_hold
from reobserve.numerics.random_streams import random_stream
from reobserve.observers.fixed_gain import FixedGainObserver, luenberger, steady_kalman
from reobserve.plain_data.files import NAME, NUMBER
from reobserve.scoring.metrics import Metric
from reobserve.scoring.responses import root_mean_square
from reobserve.timeseries.series import Channel, Series, Shape

Array = NDArray[np.float64]

# --- The keys of the ledger -----------------------------------------------------------------------


@dataclass(frozen=True)
class Plant:
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
    noise: Positive
    title: str = ""


@dataclass(frozen=True)
class Design:
    pole: Positive
    title: str = ""


@dataclass(frozen=True)
class Placed:
    algorithm: Literal["luenberger"]
    design: str
    label: str = ""


@dataclass(frozen=True)
class Kalman:
    algorithm: Literal["kalman"]
    noise: Positive
    label: str = ""


@dataclass(frozen=True, kw_only=True)
class Study(types.Study):
    design: str
    noises: Levels


@dataclass(frozen=True)
class Metrics:
    settled: Positive


@dataclass(frozen=True, kw_only=True)
class Response(types.Figure):
    layout: Literal["response"]


@dataclass(frozen=True, kw_only=True)
class OverNoise(types.StudyFigure):
    layout: Literal["noises"]


@dataclass(frozen=True)
class Ledger:
    plant: Plant
    scenarios: Mapping[str, Scenario]
    designs: Mapping[str, Design]
    observers: Mapping[str, Placed | Kalman]
    studies: Mapping[str, Study]
    metrics: Metrics
    figures: Mapping[str, Response | OverNoise]


# --- What is simulated, and by what it is observed ------------------------------------------------


def sampled(plant: Plant, sign: float = 1.0) -> tuple[Array, Array]:
    """A and the effects of u and d over a step; ``sign`` is that of the damper in (2)."""
    (m1, m2), k, c = plant.masses, plant.stiffness, plant.damping
    first, second = [-k, k, -c, c], [k, -k, sign * c, -sign * c]
    A = np.vstack([np.eye(4)[2:], np.divide(first, m1), np.divide(second, m2)])
    forces = np.vstack([np.zeros((2, 2)), np.diag([1 / m1, 1 / m2])])
    return zero_order_hold(A, forces, plant.step)


def simulate(job: Job) -> Series:
    """From rest, under a square wave of force and gusts that are new at every step."""
    plant, (A, effects) = job.plant, sampled(job.plant)
    time = np.arange(round(plant.horizon / plant.step) + 1) * plant.step
    force = np.where(time % plant.force_period < plant.force_period / 2, plant.force, -plant.force)
    gusts = plant.gusts * random_stream(job.seed, "gusts").normal(size=len(time))
    state = np.zeros((len(time), 4))
    for row, both in enumerate(np.column_stack([force, gusts])[:-1]):
        state[row + 1] = A @ state[row] + effects @ both
    x = {"position": Channel(state[:, :2], "m"), "force": Channel(force, "N")}
    measured = state[:, 0] + noise(job, job.scenario.noise, len(time))
    return Series(time, {**x, "measured": Channel(measured, "m")})


def noise(job: Job, deviation: float, rows: int) -> Array:
    """Of the sensor [m]."""
    return deviation * random_stream(job.seed, "sensor").normal(size=rows)


def plant(_: Job) -> dict[str, Shape]:
    """What a record holds."""
    return {"position": Shape("m", 2), "force": Shape("N"), "measured": Shape("m")}


def estimates(_: Job) -> dict[str, Shape]:
    """What an observer estimates."""
    return {"position": Shape("m", 2)}


def compute(job: Job) -> dict[str, Any]:
    """A design: where the error's poles lie after a step."""
    return {"poles": [float(np.exp(-job.design.pole * job.plant.step))] * 4}


def build(plant: Plant, poles: list[float] | None, deviation: float) -> FixedGainObserver:
    """The observer of these poles, or without them Kalman's for this noise."""
    A, effects = sampled(plant)
    gust, H = plant.gusts * effects[:, 1:], [[1.0, 0.0, 0.0, 0.0]]
    model = LinearModel(A, effects[:, :1], H, gust @ gust.T, deviation**2, sampling_period=plant.step)
    return luenberger(model, poles) if poles else steady_kalman(model)


def position(built: FixedGainObserver, measured: Array, force: Array) -> Array:
    """Estimates of x1 and x2 [m], from rest."""
    positions: Array = built.run(measured, force, state=built.init(np.zeros(4), 0.0))["state"][:, :2]
    return positions


def estimate(job: Job, record: Series, design: Mapping[str, Any] | None = None) -> Series:
    """One observer on a record."""
    built = build(job.plant, design and design["poles"], getattr(job.observer, "noise", 1.0))
    found = position(built, record["measured"], record["force"])
    return Series(record.time, {"position": Channel(found, "m")})


# --- Study, numbers, drawings ---------------------------------------------------------------------

KINDS = {"observer": NAME, "noise": NUMBER, "rms_error": NUMBER}
HEADER = tuple(KINDS)
MEANINGS = {
    "rms_error": "root mean square error of x2 once it has settled",
    "rms_error noise=<noise>": "the same with another noise, which the Kalman filter is told",
}


def rms_error(job: Job, record: Series, found: Array) -> float:
    settled = record.time >= job.metrics.settled
    return float(root_mean_square((found - record["position"])[settled, 1]))


def run(job: Job, record: Series, design: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The study: both observers on the same motion, more or less finely measured."""
    rows = []
    for level in job.study.noises:
        measured = record["position"][:, 0] + noise(job, level, len(record.time))
        for name, stated in job.observers.items():
            poles = design["poles"] if isinstance(stated, Placed) else None
            found = position(build(job.plant, poles, level), measured, record["force"])
            rows.append(dict(zip(HEADER, (name, level, rms_error(job, record, found)), strict=True)))
    return rows


def measure(data: FigureData) -> Iterator[Metric]:
    """RMS errors, over noise where the figure has a study."""
    for name, found in data.estimates.items():
        yield Metric(name, "rms_error", rms_error(data.job, data.plant, found["position"]), "m")
    for (name, level), rows in data.study.groups("observer", "noise") if data.study else ():
        yield Metric.at(name, ("rms_error", rows.value("rms_error"), "m"), noise=level)


def response(data: FigureData) -> Any:
    """x2 and its estimates, and their errors."""
    figure, (above, below) = new_figure((1.9, 1.5))
    time, truth = data.plant.time, data.plant["position"][:, 1]
    above.plot(time, truth, **TRUTH.line(), label="true")
    for style, (name, found) in zip(STYLES, data.estimates.items(), strict=False):
        label = data.job.observers[name].label
        above.plot(time, found["position"][:, 1], **style.line(), label=label)
        below.plot(time, found["position"][:, 1] - truth, **style.line())
    above.set_ylabel("x₂ [m]")
    below.set_ylabel("error of x₂ [m]")
    above.legend(ncols=3)
    time_axis(below, time)
    return figure


def over_noise(data: FigureData) -> Any:
    """The error of x2 over the deviation of the noise."""
    figure, (axes,) = new_figure((2.4,))
    for style, ((name,), rows) in zip(STYLES, data.study.groups("observer"), strict=False):
        label = data.job.observers[name].label
        axes.loglog(rows["noise"], rows["rms_error"], **style.points(), label=label)
    axes.set_xlabel("standard deviation of the sensor's noise [m]")
    axes.set_ylabel("RMS error of x₂ [m]")
    decades(axes.xaxis)
    decades(axes.yaxis)
    axes.legend()
    return figure


LAYOUTS = {"response": response, "noises": over_noise}
CHECKS = Checks(build={"design": compute})
