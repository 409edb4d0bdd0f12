"""State of Van der Pol's oscillator under an unmodelled force, one state measured with noise.

    x1' = x2,     x2' = -a x1 + b (1 - x1^2) x2 + d,     y = x1 + v

Methods know a = b = 1 and no force: d is normal and held for 0.2 s.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np

from reobserve.core.validation import Positive
from reobserve.observers.high_gain import HighGainObserver
from reobserve.observers.levant import LevantDifferentiator
from reobserve.observers.nonlinear_filter import ExtendedKalmanFilter, UnscentedKalmanFilter
from reobserve.observers.normal_form import IdentityObserver
from reobserve.synthesis.normal_form.transform import normal_form
from reobserve.systems.nonlinear import NonlinearModel
from reobserve.systems.polynomial import PolynomialSystem
from reobserve.systems.triangular_text import triangular_model
from reobserve.tuning.search import Settings
from reobserve.tuning.task import (
    Array,
    Condition,
    Estimates,
    Runner,
    TaskRecord,
    estimates_of,
    estimates_with,
)
from reobserve_papers.signals.random_streams import held_normal, random_stream

FIELD = ("x2", "-x1 + (1 - x1^2)*x2")
UNCERTAIN = ("x2", "-a*x1 + b*(1 - x1^2)*x2")
HOLD = 0.2  # [s], of the force


@dataclass(frozen=True)
class Plant:
    """The noise of the measurement, the rms of the force, and where records start."""

    noise: Positive
    force: Positive
    horizon: Positive  # [s]
    start: Positive  # each state is uniform from minus to plus this


def simulate(plant: Plant, condition: Condition, seed: int, period: float) -> TaskRecord:
    """A record, by the classical Runge-Kutta method with the sampling period as its step."""
    draw = random_stream(seed, "bench", "vdp", "plant")
    x1, x2 = draw.uniform(-plant.start, plant.start, 2).tolist()
    a, b = (1.0 + condition.model * float(share) for share in draw.uniform(-1.0, 1.0, 2))
    steps = round(plant.horizon / period)
    force = plant.force * held_normal(draw, steps + 1, round(HOLD / period))[0]
    states = np.empty((steps + 1, 2))
    for k, d in enumerate(force.tolist()):
        states[k] = x1, x2

        def rate(p: float, v: float, d: float = d) -> float:
            return -a * p + b * (1.0 - p * p) * v + d

        h, half = period, 0.5 * period
        v1, r1 = x2, rate(x1, x2)
        v2, r2 = x2 + half * r1, rate(x1 + half * v1, x2 + half * r1)
        v3, r3 = x2 + half * r2, rate(x1 + half * v2, x2 + half * r2)
        v4, r4 = x2 + h * r3, rate(x1 + h * v3, x2 + h * r3)
        x1, x2 = x1 + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4), x2 + h / 6 * (r1 + 2 * r2 + 2 * r3 + r4)
    noise = random_stream(seed, "bench", "vdp", "noise").standard_normal((steps + 1, 1))
    measured = states[:, :1] + condition.noise * plant.noise * noise
    every = slice(None, None, condition.period)
    time = period * np.arange(steps + 1.0)
    return TaskRecord(time[every], np.zeros((steps + 1, 1))[every], measured[every], states[every])


@cache  # the functions are compiled once for all settings, whose noise each run is given
def _sampled(period: float, *, uncertain: bool) -> NonlinearModel:
    """The model of x1 and x2, and of a and b as constant states if they are uncertain."""
    names = ["x1", "x2"]
    if not uncertain:
        return NonlinearModel.from_ode(
            FIELD, ["x1"], Q=1.0, R=1.0, state_names=names, sampling_period=period
        )
    model = NonlinearModel.from_ode(
        UNCERTAIN, ["x1"], Q=1.0, R=1.0, state_names=names, parameters={"a": 1.0, "b": 1.0},
        sampling_period=period,
    )  # fmt: skip
    return model.with_parameter_states({"a": 0.0, "b": 0.0})


def kalman(kind: Any, plant: Plant, s: Settings, period: float, noise: float) -> Runner:
    """Process noise of each state by its deviation a root of a second, ``x1`` and ``x2``.

    With ``spread``, that of a and b, these are states; with ``memory`` [s] R is estimated, from
    that of ``noise`` on.
    """
    q = 2 if "spread" in s else 0
    observer = kind(_sampled(period, uncertain=q > 0), noise_memory=s.get("memory"))
    Q = np.array([s["x1"], s["x2"], *[0.0] * q]) ** 2 * period
    P = [noise**2, plant.start**2 / 3, *[s.get("spread", 0.0) ** 2] * q]

    def run(record: TaskRecord) -> Estimates:
        y, noises = record.measurements, {"Q": Q}
        start = observer.init([y[0, 0], 0.0, *[1.0] * q], P)
        if observer.noise_memory is None:
            noises["R"] = np.array(noise**2)
        else:
            start = replace(start, noise=np.array([noise**2]))
        estimates = estimates_with("covariance", observer, "state", y, start=start, **noises)
        return Estimates(estimates.values[:, :2], estimates.covariances[:, :2, :2])

    return run


@cache
def _system() -> PolynomialSystem:
    return PolynomialSystem.from_expressions(FIELD, ["x1"], ["x1", "x2"], 3)


def normal(plant: Plant, s: Settings, period: float, _: float) -> Runner:
    """A normal-form observer of ``order``, its poles by ``frequency`` [1/s] and ``damping``."""
    frequency, ratio, order = s["frequency"], s["damping"], round(s["order"])
    pole = frequency * complex(-ratio, math.sqrt(1.0 - ratio**2))
    form = normal_form(_system(), order + 1, poles=[pole, pole.conjugate()])
    observer = IdentityObserver(form, order=order, gain="series", sampling_period=period)

    def run(record: TaskRecord) -> Array:
        y = record.measurements
        return estimates_of(observer, "state", y, start=observer.init([y[0, 0], 0.0]))

    return run


_model = cache(lambda: triangular_model(["x1", "x2"], ["0", FIELD[1]], "0"))


def high_gain(plant: Plant, s: Settings, period: float, _: float) -> Runner:
    """Both poles of the linear error at -``rho`` [1/s]."""
    observer = HighGainObserver(_model(), rho=s["rho"], sampling_period=period)

    def run(record: TaskRecord) -> Array:
        y, start = record.measurements, observer.init([record.measurements[0, 0], 0.0])
        return estimates_of(observer, "state", y, record.inputs, start=start)

    return run


def levant(plant: Plant, s: Settings, period: float, _: float) -> Runner:
    """The measurement and its derivative, by order 2 with the bound ``L`` and ``lambda0``."""
    observer = LevantDifferentiator(
        L=s["L"], order=2, lambdas=(s["lambda0"], 1.5, 1.1), sampling_period=period
    )
    return lambda record: estimates_of(observer, "derivatives", record.measurements)[:, :2]


METHODS: dict[str, Callable[..., Runner]] = {
    "ekf": partial(kalman, ExtendedKalmanFilter),
    "ukf": partial(kalman, UnscentedKalmanFilter),
    "normal_form": normal,
    "high_gain": high_gain,
    "levant": levant,
}
