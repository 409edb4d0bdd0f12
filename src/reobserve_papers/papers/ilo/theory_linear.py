"""Limits of stability and accuracy of the observers, linearised at rest."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np

from reobserve.synthesis.ilo_accuracy import (
    error_transfer,
    matched_integrator,
    pi_error_transfer,
    sampled_error_transfer,
)
from reobserve.synthesis.ilo_certificate import certify
from reobserve.synthesis.ilo_error_system import Complex, LearningLaw
from reobserve.synthesis.ilo_sampled_stability import (
    held_blocks,
    sampled_limit_gain,
    sampled_map,
    sampled_stability,
)
from reobserve.synthesis.ilo_stability import continuous_stability
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.theory_parts import part
from reobserve_papers.papers.ilo import keys
from reobserve_papers.papers.ilo.body import known_body
from reobserve_papers.papers.ilo.metrics import LEARNING
from reobserve_papers.papers.ilo.setup import pure_integrator
from reobserve_papers.parameters.job import named

_SHORTEST = 1e-6  # [s] lower end of the search for the longest accurate interval
_HIGHEST = 30.0  # times the minimum frequency of a disturbance; above it the body hardly moves


def measure(job: keys.Job) -> Iterator[Metric]:
    """Compute the numbers of `reobserve_papers.papers.ilo.theory` that need no run."""
    axis = job.metrics.axis - 1
    laws = {name: _law(job, name) for name in keys.VARIANTS}
    yield from _sampled(laws["sampled"], job.theory, axis)
    variant = laws[job.metrics.variant], job.metrics.variant == "sampled", job
    yield from _learning(*variant)
    yield from _over_rivals(*variant)
    for name in ("continuous", "forgetting"):
        yield from _accuracy(name, laws[name], job.theory, axis)


def _law(job: keys.Job, name: str) -> LearningLaw:
    observer = named(job.observers, name, keys.VARIANTS[name])
    body = known_body(job.plant)
    return LearningLaw(
        body.inertia, observer.observer_gain, body.fault_matrix, observer.K1, observer.K2,
        observer.update_interval,
    )  # fmt: skip


@part
def _learning(law: LearningLaw, held: bool, job: keys.Job) -> Iterator[Metric]:
    """Numbers of the variant of (3) that the parameter file names."""
    gain = (
        sampled_stability(law).spectral_radius
        if held
        else continuous_stability(law).worst_round_gain
    )
    yield Metric(LEARNING, "worst_round_gain", gain, "1")
    distance = _distance(law, held, job.theory.frequency, job.metrics.axis - 1)
    yield Metric(LEARNING, "distance_from_integrator", distance, "1")
    certified = certify(law.observer_gain, law.fault_matrix, law.K1, law.K2).certified
    yield Metric(LEARNING, "certified", float(certified), "1")


@part
def _over_rivals(law: LearningLaw, held: bool, job: keys.Job) -> Iterator[Metric]:
    """Error under a sine over that of rivals with the same K2 and tau.

    It is nan if v is held with unstable gains. `zero`, which estimates nothing, has an error of
    one.
    """
    theory, axis = job.theory, job.metrics.axis - 1
    omega, gains = theory.frequency, matched_integrator(law.K2, law.update_interval)
    integrator = pure_integrator(job, gains.integral_gain.tolist(), theory.damping_ratio)
    without = _error(omega, replace(law, K1=0.0 * law.K1), held)
    body = law.inertia, law.observer_gain, law.fault_matrix
    both = gains.integral_gain, gains.proportional_gain
    rivals = {
        "none": without[axis, axis],
        "integrator": pi_error_transfer(
            omega, law.inertia, integrator.observer_gain, law.fault_matrix, integrator.integral_gain
        )[0, axis, axis],
        "proportional_integral": pi_error_transfer(omega, *body, *both)[0, axis, axis],
    }
    stable = not held or sampled_stability(law).verdict == "stable"
    mine = abs(_error(omega, law, held)[axis, axis]) if stable else float("nan")
    for whose, size in ((LEARNING, mine), ("zero", 1.0)):
        for rival, error in rivals.items():
            score = ("sine_error_over", float(size / abs(error)), "1")
            yield Metric.at(whose, score, rival=rival)


@part
def _sampled(law: LearningLaw, theory: keys.Theory, axis: int) -> Iterator[Metric]:
    """Numbers of the variant that holds v between updates."""
    shown = _disturbance_gain(law, theory.disturbance_frequency)
    yield Metric("sampled", "disturbance_gain", shown, "1")
    for multiple in theory.multiples:
        slower = replace(law, update_interval=multiple * law.update_interval)
        margin = sampled_limit_gain(slower)
        yield Metric.at("sampled", ("gain_margin", margin, "1"), multiple=multiple)
        gain = _noise_gain(slower, axis) if margin > 1 else float("nan")
        yield Metric.at("sampled", ("noise_gain", gain, "N m s/rad"), multiple=multiple)


def _noise_gain(law: LearningLaw, axis: int) -> float:
    """Standard deviation of v over that of rate noise, which is drawn at the updates and held.

    The noise n enters v_k = K1 v_{k-1} + K2 (w~_k + n_k) and, through v_k and Lambda, the next w~.
    """
    from scipy.linalg import solve_discrete_lyapunov

    decay, drive = held_blocks(law)
    size = len(drive)
    # v is scaled by the norm of K2 to condition the covariance.
    scale = np.repeat([1.0, 1.0 / np.linalg.norm(law.K2, 2)], size)
    entry = scale[:, None] * np.vstack([decay - np.eye(size) - drive @ law.K2, law.K2])
    step = scale[:, None] * sampled_map(law) / scale
    covariance = solve_discrete_lyapunov(step, entry @ entry.T)
    return float(np.sqrt(covariance[size + axis, size + axis]) / scale[-1])


@part
def _accuracy(name: str, law: LearningLaw, theory: keys.Theory, axis: int) -> Iterator[Metric]:
    """Errors under a sine by interval, and the longest accurate interval by frequency."""

    def error(omega: float, interval: float) -> float:
        return float(
            abs(error_transfer(omega, replace(law, update_interval=interval))[0, axis, axis])
        )

    for interval in theory.intervals:
        value = error(theory.frequency, interval)
        yield Metric.at(name, ("sine_error", value, "1"), interval=interval)
    for frequency in theory.frequencies:
        longest = _largest_interval(error, frequency, theory.accuracy)
        yield Metric.at(name, ("largest_interval", longest, "s"), frequency=frequency)


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


def _error(omega: float, law: LearningLaw, held: bool) -> Complex:
    """Transfer from the fault to its error, if v is held to the component at its frequency."""
    if not held:
        return np.asarray(error_transfer(omega, law)[0])
    turn = 1j * omega * law.update_interval
    identity = np.eye(len(law.K1))
    estimate = identity - sampled_error_transfer(omega, law)[0]
    return np.asarray(identity + estimate * np.expm1(-turn) / turn)


def _distance(law: LearningLaw, held: bool, omega: float, axis: int) -> float:
    """Relative distance between the errors of a variant and of an integrator with K2 / tau.

    The distance is the smaller of two: without and with a proportional part K2 / 2. Continuous
    updates with K1 = I tend to the latter for small tau. If v is held, only its component at the
    frequency of the fault counts (see `_error`).
    """
    error = _error(omega, law, held)[:, axis]
    gains = matched_integrator(law.K2, law.update_interval)
    body = (law.inertia, law.observer_gain, law.fault_matrix)
    distances = []
    for proportional_gain in (np.zeros_like(law.K2), gains.proportional_gain):
        integral = pi_error_transfer(omega, *body, gains.integral_gain, proportional_gain)
        distances.append(float(np.linalg.norm(error - integral[0, :, axis])))
    return min(distances) / float(np.linalg.norm(error))


def _disturbance_gain(law: LearningLaw, lowest: float) -> float:
    """Maximum gain from a torque disturbance at ``lowest`` [rad/s] or above to v.

    A disturbance enters as a fault does, so the gain to v is one minus the gain to e. Its maxima
    lie near multiples of 2 pi / tau, which are on the grid.
    """
    rounds = 2 * np.pi / law.update_interval
    first = int(np.ceil(lowest / rounds))
    grid = [np.geomspace(lowest, _HIGHEST * lowest, 400), rounds * np.arange(first, first + 20)]
    error = sampled_error_transfer(np.concatenate(grid), law)
    return float(np.max(np.linalg.norm(np.eye(len(law.K1)) - error, 2, axis=(1, 2))))
