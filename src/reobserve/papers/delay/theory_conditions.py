"""The conditions of the paper's theorems, for its pendulum, its inputs and its delay."""

from __future__ import annotations

from collections.abc import Iterator
from math import factorial

import numpy as np
from numpy.typing import NDArray

from reobserve.core.random_streams import random_stream
from reobserve.papers.delay.setup import build_model, delay_bounds, input_and_derivatives
from reobserve.plants.delayed_input import DelayedInputPlant
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.replication.parameters.job import Job
from reobserve.signals.inputs import Signal
from reobserve.signals.series import Series
from reobserve.systems.triangular import TriangularModel

Array = NDArray[np.float64]

SEED = 0
ORDERS = (1, 2)
DIFFERENCE = 1e-5  # of states and delay, where derivatives are taken by central differences


@part
def measure(job: Job, ramp: Series, sine: Series) -> Iterator[Metric]:
    """Numbers on the conditions, and on the expansion with its bound.

    Lechappe et al. 2018, (3), (4), (6), (7), after (4), Theorem 1, Assumptions 1 to 4.
    """
    yield from _pendulum(job)
    yield from _delay(job, sine)
    for name, plant in (("ramp", ramp), ("sine", sine)):
        signals = input_and_derivatives(name, _signal(job, name), max(ORDERS) + 1)
        yield from _input(job, name, signals, plant)
        yield from _remainder(job, name, signals, plant)


def _signal(job: Job, name: str) -> Signal:
    return Signal.parse(name, getattr(job.theory, name), 1)


def _pendulum(job: Job) -> Iterator[Metric]:
    model = build_model(job.plant, "pendulum")
    stream = random_stream(SEED, "delay", "theory", "conditions")
    cases = int(job.theory.cases)
    points = stream.normal(scale=np.pi, size=(cases, 2, model.states))
    ratios = [
        np.linalg.norm(_drift(model, x) - _drift(model, z)) / np.linalg.norm(x - z)
        for x, z in points
    ]
    stiffness, friction, _ = model.parameters
    constant = float(np.hypot(stiffness, friction))
    yield Metric("pendulum", "lipschitz_constant", constant, "1/s^2")
    yield Metric("pendulum", "drift_over_lipschitz", float(np.max(ratios)) / constant, "1")
    gains = [abs(_gain(model, x[0])) for x, _ in points]
    yield Metric("pendulum", "least_input_gain", float(np.min(gains)), "1/(kg m^2)")
    yield Metric("pendulum", "greatest_input_gain", float(np.max(gains)), "1/(kg m^2)")
    u = input_and_derivatives("sine", _signal(job, "sine"), 1)
    most = delay_bounds(job.plant)[1]
    wrong = []
    for x, _ in points:
        t, tau = stream.uniform(0, job.plant.horizon), stream.uniform(0, most)
        slope = u[1](np.array([t - tau]))[0, 0]
        expected = -_gain(model, x[0]) * slope
        wrong.append(abs(_determinant(model, u[0], x, t, tau) - expected))
    size = max(gains) * float(np.max(np.abs(u[1](np.linspace(0, job.plant.horizon)))))
    yield Metric("pendulum", "determinant_error", float(np.max(wrong)) / size, "1")
    held = Signal.parse("held", [{"kind": "constant", "axis": 1, "from": -most, "size": 0.5}], 1)
    step = job.plant.step
    apart = [
        DelayedInputPlant(model).simulate(
            job.theory.initial_state, held, delay, step, round(10.0 / step)
        )
        for delay in (_constant(0.2 * most), _constant(0.8 * most))
    ]
    value = float(np.max(np.abs(apart[0] - apart[1])))
    yield Metric("pendulum", "difference_under_constant_input", value, "rad, rad/s")


def _constant(size: float) -> Signal:
    return Signal.parse("delay", [{"kind": "constant", "axis": 1, "size": size}], 1)


def _drift(model: TriangularModel, x: Array) -> Array:
    f = np.empty(model.states)
    model.drift(np.ascontiguousarray(x), model.parameters, f)
    return f


def _gain(model: TriangularModel, y: float) -> float:
    G = np.empty(1)
    model.input_gain(np.array([y]), model.parameters, G)
    return float(G[0])


def _determinant(model: TriangularModel, u: Signal, x: Array, t: float, tau: float) -> float:
    """Of the Jacobian of y, y' and y'' by x1, x2 and tau, by central differences (Theorem 1).

    Without a drift in its first row the pendulum has y' = x2 and y'' = x2'.
    """

    def outputs(z: Array) -> Array:
        force = _gain(model, z[0]) * u(np.array([t - z[2]]))[0, 0]
        first, second = _drift(model, z[:2])
        return np.array([z[0], z[1] + first, second + force])

    at = np.array([*x, tau])
    steps = DIFFERENCE * np.eye(3)
    columns = [(outputs(at + d) - outputs(at - d)) / (2 * DIFFERENCE) for d in steps]
    return float(np.linalg.det(np.array(columns).T))


def _delay(job: Job, plant: Series) -> Iterator[Metric]:
    delay, before = plant["delay"], plant["delay_before"]
    leaps = np.abs(delay - before)[1:]
    yield Metric("delay", "least_delay", float(np.min(delay)), "s")
    yield Metric("delay", "greatest_delay", float(np.max(delay)), "s")
    yield Metric("delay", "jumps", float(np.count_nonzero(leaps > 1e-9)), "1")
    yield Metric("delay", "largest_jump", float(np.max(leaps)), "s")


def _input(job: Job, name: str, signals: list[Signal], plant: Series) -> Iterator[Metric]:
    """How smooth and how bounded an input is (Assumption 4), and where it does not change (4)."""
    most = delay_bounds(job.plant)[1]
    inside = {b for s in signals for b in s.breaks if -most + 1e-9 < b <= plant.time[-1]}
    yield Metric(name, "breaks", float(len(inside)), "1")
    time = np.concatenate([plant.time[plant.time < most] - most, plant.time])
    for i, signal in enumerate(signals[1:], start=1):
        largest = float(np.max(np.abs(signal(time))))
        yield Metric(name, f"largest_derivative_{i}", largest, f"N m/s^{i}")
    rate = signals[1](time)[:, 0]
    changes = np.count_nonzero(np.sign(rate[1:]) != np.sign(rate[:-1]))
    least = 0.0 if changes else float(np.min(np.abs(rate)))
    yield Metric(name, "least_rate", least, "N m/s")
    yield Metric(name, "singular_instants", float(changes), "1")
    still = np.abs(rate) < 1e-9 * np.max(np.abs(rate))
    yield Metric(name, "singular_share", float(np.mean(still)), "1")


def _remainder(job: Job, name: str, signals: list[Signal], plant: Series) -> Iterator[Metric]:
    """|gamma_m| of (6) at its largest, and over its bound (7)."""
    most = delay_bounds(job.plant)[1]
    time = np.linspace(0.0, plant.time[-1], 1201)
    values = [signal(time)[:, 0] for signal in signals]
    for order in ORDERS:
        largest = float(np.max(np.abs(signals[order + 1](plant.time))))
        sizes, ratios = [], []
        for tau in np.linspace(0.1, 1.0, 10) * most:
            terms = [(-tau) ** i / factorial(i) * values[i] for i in range(order + 1)]
            gamma = np.abs(signals[0](time - tau)[:, 0] - np.sum(terms, axis=0))
            sizes.append(float(np.max(gamma)))
            bound = float(tau) ** (order + 1) / factorial(order + 1) * largest
            ratios.append(sizes[-1] / bound if bound else float("nan"))
        yield Metric.at(name, ("remainder", max(sizes), "N m"), order=order)
        if largest:
            yield Metric.at(name, ("remainder_over_bound", max(ratios), "1"), order=order)
