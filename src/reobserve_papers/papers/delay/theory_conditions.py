"""The conditions of the paper's theorems, for its pendulum, its inputs and its delay."""

from __future__ import annotations

from collections.abc import Iterator
from math import factorial

import numpy as np
from numpy.typing import NDArray

from reobserve.systems.triangular import TriangularModel
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.theory_parts import part
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.scoring import singular_instants
from reobserve_papers.papers.delay.setup import build_model, delay_bounds, input_and_derivatives
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Series

Array = NDArray[np.float64]

SEED = 0
ORDERS = (1, 2)
DIFFERENCE = 1e-5  # of states and delay, for central differences
FLOW = 1e-4  # of time, states and delay, for differences of differences


@part
def measure(job: keys.Job, ramp: Series, sine: Series) -> Iterator[Metric]:
    """Metrics of the conditions and of the expansion.

    Lechappe et al. 2018, (3), (4), after (4), (6), Theorem 1, Assumptions 3 and 4.
    """
    yield from _pendulum(job)
    yield from _turning_points(job, sine)
    yield Metric("delay", "jumps", float(len(sine.events["jumps"])), "1")
    yield Metric("delay", "minimum_delay", float(np.min(sine["delay"])), "s")
    yield Metric("delay", "maximum_delay", float(np.max(sine["delay"])), "s")
    for name, plant in (("ramp", ramp), ("sine", sine)):
        signals = input_and_derivatives(name, _signal(job, name), max(ORDERS) + 1)
        yield from _input(job, name, signals, plant)
        if name == "sine":
            yield from _remainder(job, signals, plant)


def _signal(job: keys.Job, name: str) -> Signal:
    return Signal.parse(name, getattr(job.theory, name), 1)


def _pendulum(job: keys.Job) -> Iterator[Metric]:
    model = build_model(job.plant, "pendulum")
    stream = random_stream(SEED, "delay", "theory", "conditions")
    cases = int(job.theory.cases)
    points = stream.normal(scale=np.pi, size=(cases, model.states))
    u = input_and_derivatives("sine", _signal(job, "sine"), 1)
    longest = delay_bounds(job.plant)[1]
    wrong = []
    for x in points:
        t, tau = stream.uniform(0, job.plant.horizon), stream.uniform(0, longest)
        slope = u[1](np.array([t - tau]))[0, 0]
        expected = -_gain(model, x[0]) * slope
        wrong.append(abs(_determinant(model, u[0], x, t, tau) - expected))
    size = abs(_gain(model, 0.0)) * float(np.max(np.abs(u[1](np.linspace(0, job.plant.horizon)))))
    yield Metric("pendulum", "determinant_error", float(np.max(wrong)) / size, "1")


def _turning_points(job: keys.Job, sine: Series) -> Iterator[Metric]:
    """Smallest determinant of y, y' and one more derivative where u'(t - tau) = 0, u'' is not.

    Over its size, G max |u''|: of the second derivative as in the proof of Theorem 1, and of the
    third, which [27] takes, too.
    """
    model = build_model(job.plant, "pendulum")
    u = input_and_derivatives("sine", _signal(job, "sine"), 2)
    stream = random_stream(SEED, "delay", "theory", "turning points")
    longest = delay_bounds(job.plant)[1]
    rates = np.gradient(sine["delay"], sine.time)[:: len(sine.time) // 100]
    by_order: dict[int, list[float]] = {2: [], 3: []}
    for instant in singular_instants(sine):
        at = np.array([instant])
        for _ in range(2):  # Newton
            at = at - u[1](at)[:, 0] / u[2](at)[:, 0]
        tau, rate = stream.uniform(0, longest), stream.choice(rates[np.abs(rates) < 1])
        x = stream.normal(scale=np.pi, size=model.states)
        for order, determinants in by_order.items():
            z = np.array([*x, tau, float(at[0]) + tau])
            determinants.append(abs(_with_derivative(model, u[0], z, float(rate), order)))
    size = abs(_gain(model, 0.0)) * float(np.max(np.abs(u[2](sine.time))))
    for order, determinants in by_order.items():
        score = "determinant_at_turning_points", min(determinants) / size, "1"
        yield Metric.at("pendulum", score, derivatives=order)


def _with_derivative(model: TriangularModel, u: Signal, z: Array, rate: float, order: int) -> float:
    """Determinant of the Jacobian of y, y' and the derivative of an order, 2 or 3, in x and tau.

    ``z`` is x1, x2, tau and t, ``rate`` that of tau.
    """

    def flow(z: Array) -> Array:
        first, second = _drift(model, z[:2])
        force = _gain(model, z[0]) * u(np.array([z[3] - z[2]]))[0, 0]
        return np.array([z[1] + first, second + force, rate, 1.0])

    def outputs(z: Array) -> Array:
        moving = flow(z)
        if order == 2:
            return np.array([z[0], moving[0], moving[1]])
        jerk = (flow(z + FLOW * moving) - flow(z - FLOW * moving))[1] / (2 * FLOW)
        return np.array([z[0], moving[0], jerk])

    steps = FLOW * np.eye(4)[:3]
    columns = [(outputs(z + d) - outputs(z - d)) / (2 * FLOW) for d in steps]
    return float(np.linalg.det(np.array(columns).T))


def _drift(model: TriangularModel, x: Array) -> Array:
    f = np.empty(model.states)
    model.drift(np.ascontiguousarray(x), model.parameters, f)
    return f


def _gain(model: TriangularModel, y: float) -> float:
    G = np.empty(1)
    model.input_gain(np.array([y]), model.parameters, G)
    return float(G[0])


def _determinant(model: TriangularModel, u: Signal, x: Array, t: float, tau: float) -> float:
    """Determinant of the Jacobian of y, y', y'' in x1, x2, tau by central differences (Theorem 1).

    The pendulum has no drift in its first row, so y' = x2 and y'' = x2'.
    """

    def outputs(z: Array) -> Array:
        force = _gain(model, z[0]) * u(np.array([t - z[2]]))[0, 0]
        first, second = _drift(model, z[:2])
        return np.array([z[0], z[1] + first, second + force])

    at = np.array([*x, tau])
    steps = DIFFERENCE * np.eye(3)
    columns = [(outputs(at + d) - outputs(at - d)) / (2 * DIFFERENCE) for d in steps]
    return float(np.linalg.det(np.array(columns).T))


def _input(job: keys.Job, name: str, signals: list[Signal], plant: Series) -> Iterator[Metric]:
    """Smoothness and bounds of an input (Assumption 4), and zeros of its rate (4)."""
    longest = delay_bounds(job.plant)[1]
    inside = {b for s in signals for b in s.breaks if -longest + 1e-9 < b <= plant.time[-1]}
    yield Metric(name, "breaks", float(len(inside)), "1")
    time = np.concatenate([plant.time[plant.time < longest] - longest, plant.time])
    rate = signals[1](time)[:, 0]
    changes = np.count_nonzero(np.sign(rate[1:]) != np.sign(rate[:-1]))
    minimum = 0.0 if changes else float(np.min(np.abs(rate)))
    yield Metric(name, "minimum_rate", minimum, "N m/s")
    yield Metric(name, "singular_instants", float(changes), "1")
    still = np.abs(rate) < 1e-9 * np.max(np.abs(rate))
    yield Metric(name, "singular_share", float(np.mean(still)), "1")


def _remainder(job: keys.Job, signals: list[Signal], plant: Series) -> Iterator[Metric]:
    """Maximum of |gamma_m| of (6)."""
    time = np.linspace(0.0, plant.time[-1], 1201)
    values = [signal(time)[:, 0] for signal in signals]
    for order in ORDERS:
        sizes = []
        for tau in np.linspace(0.1, 1.0, 10) * delay_bounds(job.plant)[1]:
            terms = [(-tau) ** i / factorial(i) * values[i] for i in range(order + 1)]
            gamma = np.abs(signals[0](time - tau)[:, 0] - np.sum(terms, axis=0))
            sizes.append(float(np.max(gamma)))
        yield Metric.at("sine", ("remainder", max(sizes), "N m"), order=order)
