"""Delay of the input of a scalar system, whose state is measured with noise.

    x' = -a x + b u(t - tau(t)),     y = x + v

Methods know a = b = 1, the bounds of tau, and u, u' and u'' exactly. In each third of a record the
delay steps, ramps or swings. Truth and estimates are tau less the middle of its bounds: to report
the middle has an error of 1. That is done by all who need the past of the input, up to when the
record is as long as the maximum delay.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Annotated, Any, Literal

import numpy as np

from reobserve.core.validation import Positive, rising
from reobserve.observers.extended_high_gain import ExtendedHighGainObserver, SwitchedOffWarning
from reobserve.observers.grid_filter import GridFilter
from reobserve.observers.imm import IMM
from reobserve.observers.kalman import KalmanFilter
from reobserve.observers.nonlinear_filter import ExtendedKalmanFilter
from reobserve.systems.linear import LinearModel
from reobserve.systems.nonlinear import NonlinearModel
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
from reobserve_papers.papers.delay.estimator import DelayEstimator
from reobserve_papers.papers.delay.estimator_adaptive import AdaptiveDelayEstimator
from reobserve_papers.papers.delay.estimator_least_squares import LeastSquaresDelayEstimator
from reobserve_papers.papers.delay.estimator_variable_structure import (
    VariableStructureDelayEstimator,
)
from reobserve_papers.plants.delayed_input import DelayedInputPlant
from reobserve_papers.plants.first_order_lag import first_order_lag
from reobserve_papers.signals.inputs import Signal
from reobserve_papers.signals.random_streams import random_stream

A, B = 1.0, 1.0  # a and b of (39), as methods know them
LINES = 3  # of the input
Class = Literal["step", "ramp", "swing"]
Ends = Annotated[tuple[float, float], rising]


@dataclass(frozen=True)
class Plant:
    """The noise of x, how the delay changes, and the input: lines of one amplitude."""

    noise: Positive
    horizon: Positive  # [s]
    bounds: Ends  # of the delay, as methods know them [s]
    levels: Ends  # between which it steps, ramps and swings [s]
    classes: list[Class]
    swing: Ends  # frequency [rad/s]
    lines: Ends  # frequencies [rad/s], one in each third of the logarithmic scale
    amplitude: Positive
    speed: Positive  # a factor of the frequencies of the lines

    @property
    def middle(self) -> float:
        """The middle of the bounds [s]."""
        return sum(self.bounds) / 2


def simulate(plant: Plant, condition: Condition, seed: int, period: float) -> TaskRecord:
    """A record by the plant of Lechappe et al. 2018, (39), which steps at the sampling period."""
    draw = random_stream(seed, "bench", "delay", "plant")
    delay = Signal.parse("delay", _delay_terms(plant, draw, period), 1)
    ends = np.geomspace(*plant.lines, LINES + 1)
    rates = plant.speed * ends[:-1] * (ends[1:] / ends[:-1]) ** draw.uniform(size=LINES)
    control = Signal.parse("control", [
        {"kind": "sine", "axis": 1, "from": -2 * plant.bounds[1], "amplitude": plant.amplitude,
         "frequency": rate, "phase": phase}
        for rate, phase in zip(rates, draw.uniform(0.0, 2 * np.pi, LINES), strict=True)
    ], 1)  # fmt: skip
    start = draw.normal(0.0, plant.amplitude, 1)
    a, b = (1.0 + condition.model * draw.uniform(-1.0, 1.0, 2)).tolist()
    body, steps = DelayedInputPlant(first_order_lag(a * A, b * B)), round(plant.horizon / period)
    state = body.simulate(start, control, delay, period, steps)
    noise = random_stream(seed, "bench", "delay", "noise").standard_normal(state.shape)
    time, rate = period * np.arange(steps + 1.0), control.derivative("control")
    inputs = np.hstack([signal(time) for signal in (control, rate, rate.derivative("control"))])
    measured = state + condition.noise * plant.noise * noise
    every = slice(None, None, condition.period)
    return TaskRecord(
        time[every], inputs[every], measured[every], delay(time[every]) - plant.middle
    )


def _delay_terms(plant: Plant, draw: np.random.Generator, period: float) -> list[dict[str, Any]]:
    """A class in each third, in random order, which goes on from the end of the one before.

    As many random numbers are drawn whatever the classes are.
    """
    order = [name for name in draw.permutation(["step", "ramp", "swing"]) if name in plant.classes]
    level, *levels = draw.uniform(*plant.levels, 4).tolist()
    terms: list[dict[str, Any]] = []
    third = period * round(plant.horizon / (3 * period))
    for k, other in enumerate(levels):
        begin, end = k * third, (k + 1) * third if k < 2 else plant.horizon + 1.0
        jump = begin + period * round(third * draw.uniform(0.2, 0.8) / period)
        rate = float(np.exp(draw.uniform(*np.log(plant.swing).tolist())))
        kind, between = order[k % len(order)], {"axis": 1, "from": begin, "until": end}
        if kind == "step":
            terms += [{"kind": "constant", **between, "until": jump, "size": level},
                      {"kind": "constant", **between, "from": jump, "size": other}]  # fmt: skip
        elif kind == "ramp":
            terms += [{"kind": "constant", **between, "size": level},
                      {"kind": "ramp", **between, "slope": (other - level) / third}]  # fmt: skip
        else:
            # From one level to the other and back: middle - half cos(rate (t - begin)).
            middle, half = (level + other) / 2, (other - level) / 2
            terms += [{"kind": "constant", **between, "size": middle},
                      {"kind": "sine", **between, "amplitude": half, "frequency": rate,
                       "phase": -np.pi / 2 - rate * begin}]  # fmt: skip
        level = middle - half * np.cos(rate * third) if kind == "swing" else other
    return terms


def _first(plant: Plant, period: float) -> int:
    """The row from which on the input is known for as long as the maximum delay."""
    return int(np.ceil(plant.bounds[1] / period - 1e-9))


def _late(plant: Plant, first: int, rows: Array) -> Array:
    """Estimates of the delay from a row on, as the bench scores them."""
    inside = np.clip(rows, *plant.bounds) - plant.middle
    return np.concatenate([np.zeros(first), inside])[:, None]


def _late_with(plant: Plant, first: int, rows: Array, variances: Array) -> Estimates:
    """`_late`, and variances, before that row of any delay between the bounds alike."""
    before = np.full(first, (plant.bounds[1] - plant.bounds[0]) ** 2 / 12)
    return Estimates(_late(plant, first, rows), np.concatenate([before, variances])[:, None])


def extended(order: int, plant: Plant, s: Settings, period: float, _: float) -> Runner:
    """The observer of the paper with the Taylor series up to ``order``."""
    observer = ExtendedHighGainObserver(
        first_order_lag(A, B), rho=s["rho"], order=order, delay_bounds=plant.bounds,
        threshold=s["threshold"],
        sampling_period=period,
    )  # fmt: skip

    def run(record: TaskRecord) -> Array:
        y, u = record.measurements, record.inputs[:, : order + 1]
        start = observer.init(y[0], delay=plant.middle)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SwitchedOffWarning)  # slow inputs: the score shows it
            return _late(plant, 0, estimates_of(observer, "delay", y, u, start=start))

    return run


def _halved(rows: Array, period: float) -> tuple[Array, Array]:
    """u and u', then y in straight lines, at both ends and in the middle of each period.

    Rows are u, u' and y; u is read from Hermite's cubic: u = (u0 + u1) / 2 + T (u0' - u1') / 8.
    """
    (u, slope, _), (ahead, turned, _) = rows[:-1].T, rows[1:].T
    fine = np.repeat(rows, 2, axis=0)[:-1]
    fine[1::2] = (rows[:-1] + rows[1:]) / 2
    fine[1::2, 0] += period / 8 * (slope - turned)
    fine[1::2, 1] = 1.5 * (ahead - u) / period - (slope + turned) / 4
    return fine[:, :2], fine[:, 2:]


def _estimated(estimator: DelayEstimator, plant: Plant, signals: Array, rate: Array) -> Array:
    """The delay by a reconstruction, from rows of u, u' and y and, where it reads that, from y'."""
    period = estimator.sampling_period
    first = _first(plant, period)
    inputs, y = _halved(signals, period)
    measured = np.hstack([y, np.repeat(rate, 2)[: len(y), None]])[:, : estimator.measurements]
    past, now = inputs[: 2 * first + 1], slice(2 * first, None)
    start = estimator.start(float(y[2 * first, 0]), plant.middle)
    return _late(plant, first, estimator.run(measured[now], past, inputs[now], start)[:, 0])


def least_squares(plant: Plant, s: Settings, period: float, _: float) -> Runner:
    """Settings are ``covariance`` and ``forgetting``."""
    known = A, B, plant.bounds, period
    estimator = LeastSquaresDelayEstimator(*known, s["covariance"], s["forgetting"])
    return lambda record: _estimated(estimator, plant, _signals(record), record.time)


def adaptive(plant: Plant, s: Settings, period: float, _: float) -> Runner:
    """``rate`` is that of the error for a regressor of 1, Gamma over ``forgetting``."""
    known = A, B, plant.bounds, period
    gain = s["rate"] * s["forgetting"]
    estimator = AdaptiveDelayEstimator(*known, s["filter_time"], s["forgetting"], gain)
    return lambda record: _estimated(estimator, plant, _signals(record), record.time)


def relay(on: str, plant: Plant, s: Settings, period: float, _: float) -> Runner:
    """A relay of ``gain``, on signals all low-passed with the time ``lag``, which gives y'.

    lag s' = signal - s, solved for straight lines between samples.
    """
    from scipy.signal import lfilter

    known = A, B, plant.bounds, period
    estimator = VariableStructureDelayEstimator(*known, s["gain"], on)
    keep = np.exp(-period / s["lag"])
    before = (1 - keep) * s["lag"] / period

    def run(record: TaskRecord) -> Array:
        signals = _signals(record)
        start = before * signals[:1]
        smooth, _ = lfilter([1 - before, before - keep], [1, -keep], signals, axis=0, zi=start)
        return _estimated(estimator, plant, smooth, (signals - smooth)[:, 2] / s["lag"])

    return run


def _signals(record: TaskRecord) -> Array:
    """u, u' and y."""
    return np.hstack([record.inputs[:, :2], record.measurements])


@cache  # the functions are compiled once for all settings, whose noise each run is given
def _sampled(least: float, most: float, period: float, taps: int) -> NonlinearModel:
    """The plant's x and tau, where the input of a row is u at the next row and those before it.

    x(k+1) = E x(k) + (1 - E) b / a u((k + 1/2) T - tau), E = exp(-a T), with u in straight lines.
    """
    decay = float(np.exp(-A * period))
    gain = (1.0 - decay) * B / A

    def f(x: Array, u: Array) -> Array:
        tau = min(max(x[1], least), most)
        place = 0.5 + tau / period
        tap = int(place)
        late = u[tap] + (place - tap) * (u[tap + 1] - u[tap])
        return np.array([decay * x[0] + gain * late, tau])

    def F(x: Array, u: Array) -> Array:
        tap = int(0.5 + min(max(x[1], least), most) / period)
        return np.array([[decay, gain * (u[tap + 1] - u[tap]) / period], [0.0, 1.0]])

    def h(x: Array) -> Array:
        return x[:1]

    def H(x: Array) -> Array:
        return np.array([[1.0, 0.0]])

    return NonlinearModel(
        f, h, 1.0, 1.0, F=F, H=H, states=2, inputs=taps, outputs=1, sampling_period=period
    )


def ekf(plant: Plant, s: Settings, period: float, noise: float) -> Runner:
    """The delay as a state: a random walk, ``walk`` [s/sqrt(s)], beside ``process`` of x."""
    (least, most), first = plant.bounds, _first(plant, period)
    observer = ExtendedKalmanFilter(_sampled(least, most, period, first + 2))
    Q = np.array([s["process"], s["walk"]]) ** 2 * period

    def run(record: TaskRecord) -> Estimates:
        y, u = record.measurements[first:], np.pad(record.inputs[:, 0], (0, 1), "edge")
        taps = np.lib.stride_tricks.sliding_window_view(u, first + 2)[:, ::-1]
        start = observer.init([y[0, 0], plant.middle], [noise**2, (most - least) ** 2 / 12])
        noises = {"Q": Q, "R": noise**2}
        estimates = estimates_with("variance", observer, "state", y, taps, start=start, **noises)
        return _late_with(plant, first, estimates.values[:, 1], estimates.covariances[:, 1])

    return run


def _grid(plant: Plant, s: Settings, period: float, record: TaskRecord) -> tuple[Array, Array]:
    """Delays between the bounds, and u in the middle of the period after each row, so late."""
    delays = np.linspace(*plant.bounds, round(s["delays"]))
    origins = record.time[_first(plant, period) :, None] + period / 2 - delays
    return delays, np.interp(origins, record.time, record.inputs[:, 0])


def imm(plant: Plant, s: Settings, period: float, noise: float) -> Runner:
    """A filter for each of ``delays``, of which the true one goes to a neighbour or any other.

    The rates [1/s] of the chain are ``drift`` and ``jump``.
    """
    from scipy.linalg import expm

    count, decay = round(s["delays"]), np.exp(-A * period)
    gains = (1.0 - decay) * B / A * np.eye(count)
    filters = [
        KalmanFilter(LinearModel([[decay]], [row], [[1.0]], None, Q=s["process"] ** 2 * period,
                                 R=noise**2, sampling_period=period))
        for row in gains
    ]  # fmt: skip
    rates = np.full((count, count), s["jump"] / count)
    rates += s["drift"] / 2 * (np.eye(count, k=1) + np.eye(count, k=-1))
    chain = expm(period * (rates - np.diag(rates.sum(axis=1))))
    bank = IMM(filters, chain / chain.sum(axis=1, keepdims=True))

    def run(record: TaskRecord) -> Estimates:
        (delays, late), first = _grid(plant, s, period, record), _first(plant, period)
        y = record.measurements[first:]
        weights = estimates_of(bank, "probability", y, late, start=bank.init(y[0], noise**2))
        mean = weights @ delays
        return _late_with(plant, first, mean, weights @ delays**2 - mean**2)

    return run


def grid(plant: Plant, s: Settings, period: float, noise: float) -> Runner:
    """A filter on a grid of ``delays`` and of three rates: -``rate`` [s/s], 0 and ``rate``.

    The rates ``switch`` and ``jump`` [1/s] are those of `GridFilter`; with ``memory`` [s] R is
    estimated, from that of ``noise`` on.
    """
    model = LinearModel.from_ode(
        [[-A]], [[B]], [[1.0]], Q=s["process"] ** 2 * period, R=noise**2, sampling_period=period
    )
    delays, rates = np.linspace(*plant.bounds, round(s["delays"])), [-s["rate"], 0.0, s["rate"]]
    bank = GridFilter.of_delay(
        model,
        delays=delays,
        random_walk=0.0,
        jump_rate=s["jump"],
        rates=rates,
        switch_rate=s["switch"],
        noise_memory=s.get("memory"),
    )
    assert bank.periods_late is not None
    deepest = int(bank.periods_late.max()) + 1

    def run(record: TaskRecord) -> Estimates:
        y, u = record.measurements, record.inputs[:, :1]
        held = np.vstack([(u[1:] + u[:-1]) / 2, u[-1:]])  # u in the middle of the period after each
        start = bank.init(y[deepest], noise**2, u=held[deepest])
        start, now = replace(start, past=held[:deepest]), slice(deepest + 1, None)
        estimates = estimates_with(
            "parameter_variance", bank, "parameter", y[now], held[now], start=start
        )
        return _late_with(plant, deepest + 1, estimates.values, estimates.covariances)

    return run


def parallel(plant: Plant, s: Settings, period: float, _: float) -> Runner:
    """The best of models of ``delays`` by squared errors that are forgotten with time ``memory``.

    The minimum is that of the parabola through the best one and its neighbours.
    """
    from scipy.signal import lfilter

    decay, keep = np.exp(-A * period), np.exp(-period / s["memory"])

    def run(record: TaskRecord) -> Array:
        (delays, late), first = _grid(plant, s, period, record), _first(plant, period)
        y = record.measurements[first:]
        pushed = np.vstack(
            [np.broadcast_to(y[:1], late[:1].shape), (1 - decay) * B / A * late[:-1]]
        )
        errors = y - lfilter([1.0], [1.0, -decay], pushed, axis=0)
        costs = lfilter([1 - keep], [1, -keep], errors**2, axis=0)
        best = np.clip(costs.argmin(axis=1), 1, len(delays) - 2)
        before, here, after = (costs[np.arange(len(y)), best + k] for k in (-1, 0, 1))
        bend = before - 2 * here + after
        shift = np.divide(before - after, 2 * bend, out=np.zeros_like(bend), where=bend > 0)
        step = delays[1] - delays[0]
        return _late(plant, first, delays[best] + step * np.clip(shift, -1, 1))

    return run


METHODS: dict[str, Callable[..., Runner]] = {
    "extended_1": partial(extended, 1),
    "extended_2": partial(extended, 2),
    "least_squares": least_squares,
    "adaptive": adaptive,
    "relay": partial(relay, "delay"),
    "relay_inverse": partial(relay, "inverse"),
    "ekf": ekf,
    "imm": imm,
    "grid": grid,
    "parallel": parallel,
}
