"""Fault torque of a rigid body whose rates are measured with noise.

    J w' = -w x J w + u + u_f,     y = w + v

Each axis has a fault of a random class and size from a random time on. With

    s(t) = y(t) - integral of J^-1 (u - y x J y),     J s' = u_f + noise,

what is known is subtracted, and the fault is the unknown input of a linear model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np

from reobserve.core.validation import Positive, array
from reobserve.observers.adaptive import AdaptiveObserver
from reobserve.observers.augmented_kalman import AugmentedKalmanFilter
from reobserve.observers.fault_bank import FaultBank
from reobserve.observers.ilo import ILO, SampledILO
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.levant import LevantDifferentiator
from reobserve.systems.linear import LinearModel
from reobserve.systems.rigid_body import RigidBody
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
from reobserve_papers.bench.faults import (
    FaultyPlant,
    HealthyRecord,
    random_faults,
    random_walks,
    score,
)
from reobserve_papers.plants.satellite import Satellite
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.random_streams import random_stream

__all__ = ["METHODS", "Plant", "score", "simulate"]


@dataclass(frozen=True, kw_only=True)
class Plant(FaultyPlant):
    """The rigid body, its noise and its faults [N m], with ``frequency`` of the control, too."""

    channels: ClassVar[int] = 3  # axes

    inertia: Annotated[list[list[float]], array(3, 3)]  # [kg m^2]
    noise: Positive  # standard deviation of each rate [rad/s]
    control: Positive  # amplitude of the control, a sine on each axis [N m]


def simulate(plant: Plant, condition: Condition, seed: int, period: float) -> TaskRecord:
    """A record, for which a wrong model has other moments of inertia about the same axes."""
    draw = random_stream(seed, "bench", "torque", "plant")
    steps, fine = round(plant.horizon / period), 4
    step = period / fine
    faults = random_faults(draw, plant, step)
    frequencies, phases = draw.uniform(*plant.frequency, 3), draw.uniform(0.0, 2 * np.pi, 3)
    sines = [
        {"kind": "sine", "axis": k + 1, "amplitude": plant.control, "frequency": f, "phase": p}
        for k, (f, p) in enumerate(zip(frequencies, phases, strict=True))
    ]
    control, fault = Signal.parse("control", sines, 3), Signal.parse("fault", faults, 3)
    # J = V diag(moments) V^T
    moments, V = np.linalg.eigh(np.array(plant.inertia))
    J = (V * (moments * (1.0 + condition.model * draw.uniform(-1.0, 1.0, 3)))) @ V.T
    fault.check_jumps("fault", step, plant.horizon)
    start = draw.normal(0.0, 0.03, 3)
    body = Satellite((J + J.T) / 2)
    rate = body.simulate(start, control, fault, step, steps * fine)[::fine]
    noise = random_stream(seed, "bench", "torque", "noise").standard_normal(rate.shape)
    measured = rate + condition.noise * plant.noise * noise
    time = period * np.arange(steps + 1.0)
    every = slice(None, None, condition.period)
    kind = TaskRecord if plant.scored == "all" else HealthyRecord
    return kind(time[every], control(time[every]), measured[every], fault(time[every]))


def unexplained(plant: Plant, record: TaskRecord, period: float) -> Array:
    """s = y - integral of J^-1 (u - y x J y), by the trapezoidal rule."""
    J, y = np.array(plant.inertia), record.measurements
    known = np.linalg.solve(J, (record.inputs - np.cross(y, y @ J.T)).T).T
    integral = np.cumsum(0.5 * period * (known[1:] + known[:-1]), axis=0)
    return np.asarray(y - np.vstack([np.zeros(3), integral]))


def _observer(kind: Any) -> Callable[..., Runner]:
    """An observer of the rigid body, whose gains are multiples of the inertia."""

    def make(plant: Plant, s: Settings, period: float, _: float) -> Runner:
        J = np.array(plant.inertia)
        observer = kind(RigidBody(J), J, s, period)

        return lambda r: estimates_of(observer, "fault", r.measurements, r.inputs)

    return make


def ilo(
    kind: type[ILO | SampledILO], body: RigidBody, J: Array, s: Settings, period: float
) -> ILO | SampledILO:
    """The updating ``interval`` is rounded to samples, and is one if it is left out."""
    interval = period * max(1, round(s.get("interval", period) / period))
    return kind(
        body, K1=s["K1"], K2=s["K2"] * J, observer_gain=s["observer_gain"] * J,
        update_interval=interval, sampling_period=period,
    )  # fmt: skip


def adaptive(body: RigidBody, J: Array, s: Settings, period: float) -> AdaptiveObserver:
    """An adaptive observer, an integrator if ``proportional`` is zero."""
    return AdaptiveObserver(
        body, observer_gain=s["observer_gain"] * J, integral_gain=s["integral"] * J,
        proportional_gain=s["proportional"] * J, sampling_period=period,
    )  # fmt: skip


def random_walk(smooth: bool, plant: Plant, s: Settings, period: float, noise: float) -> Runner:
    """The fault as a random walk. ``walk`` [N m / sqrt(s)], ``process`` [rad/s / sqrt(s)].

    With ``memory`` [s] R is estimated, from that of ``noise`` on.
    """
    Q, J_inverse = s["process"] ** 2 * period, np.linalg.inv(np.array(plant.inertia))
    observer = AugmentedKalmanFilter(
        LinearModel(np.eye(3), None, np.eye(3), None, Q=Q, R=noise**2, sampling_period=period),
        fault_matrix=period * J_inverse, random_walk=s["walk"] ** 2, noise_memory=s.get("memory"),
    )  # fmt: skip

    def run(record: TaskRecord) -> Estimates:
        y = unexplained(plant, record, period)
        return random_walks(observer, y, None, noise, smooth=smooth)

    return run


def with_a_rate(plant: Plant, s: Settings, period: float, noise: float) -> Runner:
    """The fault with a rate that is a random walk, ``walk`` [N m/s / sqrt(s)]."""
    T, identity = period, np.eye(3)
    A = np.kron([[1.0, T, T**2 / 2], [0.0, 1.0, T], [0.0, 0.0, 1.0]], identity)
    A[:3, 3:] = np.linalg.inv(np.array(plant.inertia)) @ A[:3, 3:]
    Q = np.kron(np.diag([s["process"] ** 2 * T, 0.0, 0.0]), identity)
    Q[3:, 3:] = s["walk"] ** 2 * np.kron([[T**3 / 3, T**2 / 2], [T**2 / 2, T]], identity)
    model = LinearModel(A, None, np.eye(3, 9), None, Q=Q, R=noise**2, sampling_period=T)
    observer = KalmanFilter(model)

    def run(record: TaskRecord) -> Estimates:
        y = unexplained(plant, record, T)
        start = observer.init(np.r_[y[0], np.zeros(6)], np.repeat([noise**2, 0.0, 0.0], 3))
        estimates = estimates_with("covariance", observer, "state", y, start=start)
        return Estimates(estimates.values[:, 3:6], estimates.covariances[:, 3:6, 3:6])

    return run


def fault_bank(plant: Plant, s: Settings, period: float, noise: float) -> Runner:
    """A bank of a fault that drifts or jumps on each axis of J s, z' = f, noise^2 (J J')_ii.

    ``drift`` [N m/s / sqrt(s)], ``jump`` [N m / sqrt(s)], ``rate`` of jumps [1/s] and ``burst`` [s]
    are those of `FaultBank`; with ``memory`` [s] it estimates R, from ``start`` times that of
    ``noise`` on: where R is too small, noise looks like jumps.
    """
    J = np.array(plant.inertia)
    variances = s.get("start", 1.0) * noise**2 * (J**2).sum(axis=1)
    axes = [
        FaultBank(
            LinearModel([[1.0]], None, [[1.0]], None, Q=0.0, R=variance, sampling_period=period),
            fault_matrix=[[period]], drift=s["drift"], jump=s["jump"], jump_rate=s["rate"],
            jump_time=s["burst"],
            noise_memory=s.get("memory"),
        )
        for variance in variances
    ]  # fmt: skip

    def run(record: TaskRecord) -> Estimates:
        z = unexplained(plant, record, period) @ J.T
        estimates = []
        for i, bank in enumerate(axes):
            start = bank.init(z[0, [i]], variances[i], fault_covariance=0.0, rate_covariance=0.0)
            estimates.append(estimates_with("fault_variance", bank, "fault", z[:, i], start=start))
        return Estimates(
            np.hstack([e.values for e in estimates]), np.hstack([e.covariances for e in estimates])
        )

    return run


def filtered_difference(plant: Plant, s: Settings, period: float, _: float) -> Runner:
    """J (s(k) - s(k-1)) / T through a low-pass of first order with the time constant ``lag``."""
    from scipy.signal import lfilter

    decay = np.exp(-period / s["lag"])

    def run(record: TaskRecord) -> Array:
        y = unexplained(plant, record, period)
        steps = np.diff(y, axis=0, prepend=y[:1]) / period
        smooth = lfilter([1.0 - decay], [1.0, -decay], steps, axis=0)
        return np.asarray(smooth @ np.array(plant.inertia).T)

    return run


def levant(plant: Plant, s: Settings, period: float, _: float) -> Runner:
    """J s' by differentiators of order 2 with the bound ``L`` [N m/s^2] and ``lambda0``."""
    J = np.array(plant.inertia)
    lambdas = (s["lambda0"], 1.5, 1.1)
    axes = [
        LevantDifferentiator(L=s["L"] / J[i, i], order=2, lambdas=lambdas, sampling_period=period)
        for i in range(3)
    ]

    def run(record: TaskRecord) -> Array:
        y = unexplained(plant, record, period)
        rates = [estimates_of(axes[i], "derivatives", y[:, i])[:, 1] for i in range(3)]
        return np.asarray(np.column_stack(rates) @ J.T)

    return run


METHODS: dict[str, Callable[..., Runner]] = {
    "sampled_ilo": _observer(partial(ilo, SampledILO)),
    "ilo": _observer(partial(ilo, ILO)),
    "adaptive": _observer(adaptive),
    "random_walk": partial(random_walk, False),
    "smoothed": partial(random_walk, True),
    "with_a_rate": with_a_rate,
    "fault_bank": fault_bank,
    "filtered_difference": filtered_difference,
    "levant": levant,
}
