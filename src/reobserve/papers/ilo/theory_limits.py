"""Limits of stability and accuracy of the ledger's observers, linearised at rest."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from reobserve.papers.ilo import keys
from reobserve.papers.ilo.body import known_body
from reobserve.papers.ilo.reading import READINGS
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.replication.parameters.job import Job, named
from reobserve.synthesis.ilo_accuracy import (
    error_transfer,
    matched_integrator,
    pi_error_transfer,
    sampled_error_transfer,
)
from reobserve.synthesis.ilo_error_system import Complex, LearningLaw
from reobserve.synthesis.ilo_sampled_stability import (
    held_blocks,
    sampled_limit_gain,
    sampled_map,
    sampled_stability,
)
from reobserve.synthesis.ilo_stability import continuous_stability
from reobserve.systems.rigid_body import RigidBody

_SHORTEST = 1e-6  # [s] from here on the largest accurate interval is sought
_HIGHEST = 30.0  # times the least frequency of a disturbance; above it the body hardly moves


def measure(job: Job) -> Iterator[Metric]:
    """The numbers of `reobserve.papers.ilo.theory` that need no run.

    Raises
    ------
    InputError
        If a value of the ledger cannot be used.
    """
    theory, observers = job.theory, job.observers
    learning = named(observers, "continuous", keys.Continuous)
    body, axis = known_body(job.plant), job.metrics.axis - 1
    laws = {name: _law(body, named(observers, name, kind)) for name, kind in READINGS.items()}
    yield from _sampled(laws["sampled"], theory.multiples, axis)
    for name in ("continuous", "forgetting"):
        stability = continuous_stability(laws[name])
        count = stability.unstable_roots
        yield Metric(name, "unstable_roots", float("nan") if count is None else count, "1")
        yield Metric(name, "worst_round_gain", stability.worst_round_gain, "1")
    for name, law in laws.items():
        held = name == "sampled"
        distance = _distance(law, held, theory.frequency, axis)
        yield Metric(name, "distance_from_integrator", distance, "1")
        gain = _disturbance_gain(law, held, theory.disturbance_frequency)
        yield Metric(name, "disturbance_gain", gain, "1")
    for K1 in theory.excessive_learning_gains:
        rate = continuous_stability(_law(body, replace(learning, K1=K1))).growth_rate
        found = float("nan") if rate is None else rate
        yield Metric.at("continuous", ("growth_rate", found, "1/s"), K1=K1)
    yield from _accuracy(_law(body, learning), theory, axis)
    yield from _resemblance(_law(body, learning), theory.frequency, axis)
    rate = _decay_rate(body, named(observers, "adaptive", keys.Adaptive))
    yield Metric("adaptive", "decay_rate_at_rest", rate, "1/s")


def _law(body: RigidBody, observer: keys.Learning) -> LearningLaw:
    return LearningLaw(
        body.inertia, observer.damping, body.fault_matrix, observer.K1, observer.K2,
        observer.update_interval,
    )  # fmt: skip


@part
def _sampled(law: LearningLaw, multiples: list[int], axis: int) -> Iterator[Metric]:
    for multiple in multiples:
        slower = replace(law, update_interval=multiple * law.update_interval)
        margin = sampled_limit_gain(slower)
        yield Metric.at("sampled", ("gain_margin", margin, "1"), multiple=multiple)
        gain = _noise_gain(slower, axis) if margin > 1 else float("nan")
        yield Metric.at("sampled", ("noise_gain", gain, "N m s/rad"), multiple=multiple)
    factors = np.linalg.eigvals(sampled_map(law)).astype(np.complex128)
    poles = np.log(factors[np.abs(factors) > 0]) / law.update_interval
    radius = sampled_stability(law).spectral_radius
    yield Metric("sampled", "worst_round_gain", radius, "1")
    yield Metric("sampled", "slowest_decay", -float(np.max(poles.real)), "1/s")
    yield Metric("sampled", "damping_ratio", float(np.min(-poles.real / np.abs(poles))), "1")


def _noise_gain(law: LearningLaw, axis: int) -> float:
    """Standard deviation of v over that of a noise on the rates, drawn and held at the updates.

    The noise n enters v_k = K1 v_{k-1} + K2 (w~_k + n_k) and, through v_k and Lambda, the next w~.
    """
    from scipy.linalg import solve_discrete_lyapunov

    decay, drive = held_blocks(law)
    size = len(drive)
    # v in units of K2 per rate, lest the covariance be badly scaled.
    scale = np.repeat([1.0, 1.0 / np.linalg.norm(law.K2, 2)], size)
    entry = scale[:, None] * np.vstack([decay - np.eye(size) - drive @ law.K2, law.K2])
    step = scale[:, None] * sampled_map(law) / scale
    covariance = solve_discrete_lyapunov(step, entry @ entry.T)
    return float(np.sqrt(covariance[size + axis, size + axis]) / scale[-1])


@part
def _accuracy(law: LearningLaw, theory: keys.Theory, axis: int) -> Iterator[Metric]:
    """How the error under a sine follows the interval and the frequency."""

    def error(omega: float, interval: float) -> float:
        return float(
            abs(error_transfer(omega, replace(law, update_interval=interval))[0, axis, axis])
        )

    intervals, omega = theory.intervals, theory.frequency
    errors = [error(omega, interval) for interval in intervals]
    for interval, value in zip(intervals, errors, strict=True):
        yield Metric.at("continuous", ("sine_error", value, "1"), interval=interval)
    slope = float(np.polyfit(np.log(intervals), np.log(errors), 1)[0])
    yield Metric("continuous", "sine_error_slope", slope, "1")
    for frequency in theory.frequencies:
        longest = _largest_interval(error, frequency, theory.accuracy)
        yield Metric.at("continuous", ("largest_interval", longest, "s"), frequency=frequency)


def _largest_interval(
    error: Callable[[float, float], float], omega: float, accuracy: float
) -> float:
    """The longest interval, up to half a period of the sine, with an error below ``accuracy``."""
    from scipy.optimize import brentq

    def excess(logarithm: float) -> float:
        return float(np.log(error(omega, float(np.exp(logarithm))) / accuracy))

    grid = np.log(np.geomspace(_SHORTEST, np.pi / omega, 61))
    if excess(grid[0]) > 0:
        return float("nan")
    for low, high in pairwise(grid):
        if excess(high) > 0:
            return float(np.exp(brentq(excess, low, high)))
    return float(np.pi / omega)


@part
def _resemblance(law: LearningLaw, omega: float, axis: int) -> Iterator[Metric]:
    """How far the errors of learning at every instant are from those of a matched observer."""
    learning = error_transfer(omega, law)[0, :, axis]
    gains = matched_integrator(law.K2, law.update_interval)
    matched = _integral(law, omega, gains.proportional_gain)[0, :, axis]
    distance = float(np.linalg.norm(learning - matched) / np.linalg.norm(learning))
    yield Metric("continuous", "distance_from_matched", distance, "1")


def _distance(law: LearningLaw, held: bool, omega: float, axis: int) -> float:
    """How far the errors of a reading are from those of an integrator with K2 / tau.

    Of a v that is held the part counts that has the frequency of the fault.
    """
    error = error_transfer(omega, law)
    if held:
        turn = 1j * omega * law.update_interval
        one = np.eye(len(law.K1))
        error = one - (one - sampled_error_transfer(omega, law)) * -np.expm1(-turn) / turn
    integral = _integral(law, omega, 0.0)[0, :, axis]
    error = error[0, :, axis]
    return float(np.linalg.norm(error - integral) / np.linalg.norm(error))


def _integral(law: LearningLaw, omega: float, proportional_gain: ArrayLike) -> Complex:
    """The error of an integrator with K2 / tau and the Lambda of the law."""
    gain = matched_integrator(law.K2, law.update_interval).integral_gain
    body = (law.inertia, law.damping, law.fault_matrix)
    return pi_error_transfer(omega, *body, gain, proportional_gain)


def _disturbance_gain(law: LearningLaw, held: bool, lowest: float) -> float:
    """The largest part of a torque disturbance at ``lowest`` [rad/s] or above that shows in v.

    A disturbance enters as a fault does, and what is not error of the estimate is estimate; its
    maxima lie near multiples of 2 pi / tau, which the grid holds.
    """
    rounds = 2 * np.pi / law.update_interval
    first = int(np.ceil(lowest / rounds))
    grid = [np.geomspace(lowest, _HIGHEST * lowest, 400), rounds * np.arange(first, first + 20)]
    error = (sampled_error_transfer if held else error_transfer)(np.concatenate(grid), law)
    return float(np.max(np.linalg.norm(np.eye(len(law.K1)) - error, 2, axis=(1, 2))))


def _decay_rate(body: RigidBody, observer: keys.Adaptive) -> float:
    """The slowest decay [1/s] of the adaptive observer's errors, at rest and without a torque."""
    one = np.eye(3)
    feedthrough = body.fault_matrix * observer.proportional_gain
    matrix = np.block(
        [
            [
                -body.inverse @ (observer.damping * one + feedthrough),
                body.inverse @ body.fault_matrix,
            ],
            [-observer.integral_gain * one, np.zeros((3, 3))],
        ]
    )
    return -float(np.max(np.linalg.eigvals(matrix).real))
