"""Stage theory: proofs of the paper, their consequences, and runs that are not in the figures."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.synthesis.ilo_certificate import certify, lemma1_sides
from reobserve.synthesis.ilo_error_system import LearningLaw
from reobserve.synthesis.ilo_stability import continuous_stability
from reobserve.systems.rigid_body import RigidBody
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.theory_parts import part
from reobserve_papers.papers.ilo import keys, theory_linear, theory_runs
from reobserve_papers.papers.ilo.metrics import LEARNING
from reobserve_papers.parameters.job import named
from reobserve_papers.signals.random_streams import random_stream

Array = NDArray[np.float64]

_JUST_INSIDE = 1.001  # times the minimum Lambda that Theorem 1 certifies
_JUST_OUTSIDE = 1 - 1e-12
_AMPLE = 1e6  # a Lambda [N m s/rad] that would certify K1 = I if any did
_ROWS = 20  # cases of Lemma 1 with the same gains
_AXES = 3
_LARGE = 1e3  # times |w|: an error at which only the quadratic part of the torque counts
_PEAKS = 1000  # of the mismatch that refutes the end of the proof


def measure(job: keys.Job, designs: dict[str, Any]) -> list[Metric]:
    """Compute the numbers of the theory (see `MEANINGS` of `metrics`)."""
    body = (job.plant.inertia, job.plant.input_matrix, job.plant.fault_matrix)
    return [
        *_without_observers(json.dumps([asdict(job.theory), *body])),
        *theory_linear.measure(job),
        *operations(job),
        *theory_runs.measure(job),
    ]


@part
@lru_cache(maxsize=4)
def _without_observers(stated: str) -> tuple[Metric, ...]:
    """Numbers that need no observer, cached, since sampling varies the gains many times."""
    given, *matrices = json.loads(stated)
    theory = keys.Theory(**given)
    body = RigidBody(*matrices)
    return (*_lemma(theory), *_theorem(theory, body), *_proof(theory, body))


def _lemma(theory: keys.Theory) -> Iterator[Metric]:
    """Violations of Lemma 1 in random cases. Without a mismatch its right side is that of (12)."""
    stream = random_stream(theory.random_seed, "ilo", "lemma 1")
    violations, constant = 0, 0
    for _ in range(theory.cases // _ROWS):
        K1, K2 = stream.normal(size=(2, 3, 3)) * 10 ** stream.uniform(-2, 2, (2, 1, 1))
        weights = 10 ** stream.uniform(-3, 3, 3)
        sizes = 10 ** stream.uniform(-2, 2, (3, _ROWS, 1))
        past, rate, mismatch = stream.normal(size=(3, _ROWS, 3)) * sizes
        left, right = lemma1_sides(past, rate, mismatch, K1, K2, *weights)
        # (12) has 1 + gamma_1 and 1 + 1 / gamma_1, the limits of the constants of (11).
        tending = (weights[0], 1e-9, 1e-9)
        without = lemma1_sides(past, rate, np.zeros_like(past), K1, K2, *tending)
        violations += int(np.sum(left > right * (1 + 1e-12)))
        constant += int(np.sum(without[0] > without[1] * (1 + 1e-12)))
    yield Metric("lemma_1", "violations", float(violations), "1")
    yield Metric("lemma_1", "violations_without_mismatch", float(constant), "1")


def _theorem(theory: keys.Theory, body: RigidBody) -> Iterator[Metric]:
    """Errors of designs that Theorem 1 certifies, and the share of unstable ones."""
    fault = body.fault_matrix
    needed = certify(_AMPLE, fault, 1.0, theory.learning_gains[0]).required_observer_gain
    needed = needed if np.isfinite(needed) else float("nan")
    yield Metric("theorem_1", "required_observer_gain_at_identity", needed, "N m s/rad")
    left = []
    for k1 in theory.learning_gains:
        # With B_f = I the minimum lies at K2 = K1; another B_f scales that by its norm.
        for k2 in k1 * np.linalg.norm(fault, 2) * np.geomspace(0.01, 100.0, 41):
            least = certify(1.0, fault, k1, k2).required_observer_gain
            left.append(certify(_JUST_OUTSIDE * least, fault, k1, k2).dc_error)
    yield Metric("theorem_1", "minimum_constant_error", min(left), "1")
    unstable = [_unstable(body, *design) for design in _certified(theory, fault)]
    yield Metric("theorem_1", "unstable_share", float(np.mean(unstable)), "1")


def _proof(theory: keys.Theory, body: RigidBody) -> Iterator[Metric]:
    """Growth of the constant of Assumption 2 with the error, and the gaps of the printed proof.

    The first gap is Assumption 2, if no constant holds for all errors. The second is the end, where
    a bounded mean of |e|^2 is said to bound e: it is refuted by peaks |e|^2 = n on [n, n + n^-3).
    """
    stream = random_stream(theory.random_seed, "ilo", "assumption 2")
    rate = stream.normal(size=3)
    errors = stream.normal(size=(theory.cases // _ROWS, 3)) * _LARGE * np.linalg.norm(rate)

    def constants(error: Array) -> tuple[float, float]:
        torque = np.cross(rate, body.inertia @ rate)
        other = rate - error
        torque = torque - np.cross(other, other @ body.inertia)
        size = np.linalg.norm(error, axis=1)
        along = np.abs(np.sum(error * torque, axis=1)) / size**2
        return float(np.max(np.linalg.norm(torque, axis=1) / size)), float(np.max(along))

    growths = np.divide(constants(10 * errors), constants(errors)).tolist()
    for side, growth in zip(("two", "one"), growths, strict=True):
        yield Metric.at("assumption_2", ("growth_of_the_constant", growth, "1"), side=side)
    peaks = np.arange(1.0, _PEAKS + 1)
    means = np.cumsum(peaks * peaks**-3) / peaks  # of |e|^2 over [0, n + 1)
    gaps = [growths[0] > 2, bool(np.max(means) <= means[0] and peaks[-1] > peaks[0])]
    yield Metric("theorem_1", "gaps", float(sum(gaps)), "1")


def _certified(theory: keys.Theory, fault: Array) -> Iterator[tuple[float, Array, Array, float]]:
    """Random designs just inside the conditions of Theorem 1: Lambda, K1, K2, tau."""
    stream = random_stream(theory.random_seed, "ilo", "certified designs")
    for _ in range(theory.certified_designs):
        K1, K2 = stream.normal(size=(2, 3, 3))
        K1 *= stream.uniform(0.1, 0.98) / np.linalg.norm(K1, 2)
        K2 *= 10 ** stream.uniform(-2, 2)
        observer_gain = _JUST_INSIDE * certify(1.0, fault, K1, K2).required_observer_gain
        yield observer_gain, K1, K2, float(10 ** stream.uniform(-3, 0))


def _unstable(body: RigidBody, observer_gain: float, K1: Array, K2: Array, interval: float) -> bool:
    law = LearningLaw(body.inertia, observer_gain, body.fault_matrix, K1, K2, interval)
    return continuous_stability(law).verdict != "stable"


@part
def operations(job: keys.Job) -> Iterator[Metric]:
    """Count multiplications and additions of the estimation laws per sampling period of the rate.

    Chen & Saif 2007, Remark 1.

    The count leaves out the equation of w^, which all observers have and which gives w - w^. It is
    for three axes and gains that are multiples of the identity.

        learning   v = K1 v(t - tau) + K2 (w - w^)     no product by K1 = I
        adaptive   f^' = Gamma (w - w^)                by Euler's method with the step in Gamma

    Euler's method evaluates a law once per period. The classical Runge-Kutta method evaluates it
    four times, at three instants; the adaptive law also needs three sums z + h l and finally
    z + h / 6 (l1 + 2 (l2 + l3) + l4). With either method a v that is held is updated once per
    ``theory.periods_per_update`` periods.
    """
    variant = job.metrics.variant
    observer = named(job.observers, variant, keys.VARIANTS[variant])
    euler = job.theory.integration == "euler"
    held = isinstance(observer, keys.Sampled)
    evaluations, instants = (1, 1) if held or euler else (4, 3)
    product = not np.array_equal(np.asarray(observer.K1), 1.0)
    count = _AXES * (2 * evaluations + product * instants)
    periods = job.theory.periods_per_update if held else 1
    yield Metric(LEARNING, "operations", count / periods, "1")
    slopes, stages, end = 4, 3 * 2, 2 + 4
    adaptive = _AXES * (2 if euler else slopes + stages + end)
    yield Metric("adaptive", "operations", float(adaptive), "1")
