"""Stage theory: what the paper proves, what follows from it, and runs that no figure shows."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.core.random_streams import random_stream
from reobserve.papers.ilo import keys, theory_cost, theory_faults, theory_limits, theory_runs
from reobserve.papers.ilo.body import known_body
from reobserve.papers.ilo.lyapunov import gyroscopic_eta
from reobserve.papers.ilo.reading import of_reading
from reobserve.papers.ilo.theorem import certify, lemma1_sides
from reobserve.papers.ilo.theory_bench import Bench
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.replication.parameters.job import Job, Settings, read_job
from reobserve.synthesis.ilo_error_system import LearningLaw
from reobserve.synthesis.ilo_stability import continuous_stability
from reobserve.systems.rigid_body import RigidBody

Array = NDArray[np.float64]

_JUST_INSIDE = 1.001  # times the least damping that Theorem 1 certifies
_JUST_OUTSIDE = 1 - 1e-12
_AMPLE = 1e6  # times the same: (18) promises least where the damping is large
_HARDLY_ANY = 1e-9  # a damping [N m s/rad] that is certified for no gains here
_ROWS = 20  # cases of Lemma 1 with the same gains


def measure(settings: Settings, designs: dict[str, Any]) -> list[Metric]:
    """The numbers of the theory; see `MEANINGS` of `metrics`.

    Raises
    ------
    InputError
        If a value of the ledger cannot be used.
    """
    job = read_job(keys.Ledger, settings)
    plant = job.plant
    body = (plant.inertia, plant.input_matrix, plant.fault_matrix)
    bench = Bench.of(job)
    found = [
        *_without_observers(json.dumps([asdict(job.theory), plant.initial_rate, *body])),
        *_certificates(job),
        *theory_limits.measure(job),
        *theory_cost.measure(job),
        *theory_runs.measure(bench),
        *theory_faults.measure(bench),
    ]
    return [*found, *of_reading(found, job.metrics.reading)]


@part
@lru_cache(maxsize=4)
def _without_observers(stated: str) -> tuple[Metric, ...]:
    """What stays as it is while gains are drawn, which is done many times."""
    given, rate, *matrices = json.loads(stated)
    theory, body = keys.Theory(**given), RigidBody(*matrices)
    return (*_lemma(theory), *_assumption(theory, rate, body), *_theorem(theory, body))


def _lemma(theory: keys.Theory) -> Iterator[Metric]:
    """Lemma 1 on random cases; without a mismatch its right side is that of (12)."""
    stream = random_stream(theory.random_seed, "ilo", "lemma 1")
    violations, constant, closest = 0, 0, np.inf
    for _ in range(theory.cases // _ROWS):
        K1, K2 = stream.normal(size=(2, 3, 3)) * 10 ** stream.uniform(-2, 2, (2, 1, 1))
        weights = 10 ** stream.uniform(-3, 3, 3)
        sizes = 10 ** stream.uniform(-2, 2, (3, _ROWS, 1))
        past, rate, mismatch = stream.normal(size=(3, _ROWS, 3)) * sizes
        left, right = lemma1_sides(past, rate, mismatch, K1, K2, *weights)
        # (12) has 1 + gamma_1 and 1 + 1 / gamma_1, to which those of (11) tend.
        tending = (weights[0], 1e-9, 1e-9)
        without = lemma1_sides(past, rate, np.zeros_like(past), K1, K2, *tending)
        violations += int(np.sum(left > right * (1 + 1e-12)))
        constant += int(np.sum(without[0] > without[1] * (1 + 1e-12)))
        closest = min(closest, float(np.min(right / left)))
    yield Metric("lemma_1", "violations", float(violations), "1")
    yield Metric("lemma_1", "violations_without_mismatch", float(constant), "1")
    yield Metric("lemma_1", "closest_ratio", closest, "1")


def _assumption(theory: keys.Theory, start: list[float], body: RigidBody) -> Iterator[Metric]:
    """Assumption 2: the largest torque difference per rate error, in directions at random."""
    stream = random_stream(theory.random_seed, "ilo", "assumption 2")
    inertia, rate = body.inertia, np.array(start)
    directions = stream.normal(size=(theory.cases, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)

    def gyroscopic(rates: Array) -> Array:
        return np.cross(rates, rates @ inertia)

    for size in theory.rate_errors:
        difference = gyroscopic(rate) - gyroscopic(rate - size * directions)
        ratio = float(np.max(np.linalg.norm(difference, axis=1))) / size
        yield Metric.at("assumption_2", ("torque_ratio", ratio, "N m s/rad"), size=size)
    eta = gyroscopic_eta(inertia, float(np.linalg.norm(rate)))
    yield Metric("assumption_2", "one_sided_constant", eta, "N m s/rad")


def _theorem(theory: keys.Theory, body: RigidBody) -> Iterator[Metric]:
    """The floors of all designs that Theorem 1 certifies, and whether such designs are stable."""
    fault = body.fault_matrix
    identity = certify(_AMPLE, fault, 1.0, theory.learning_gains[0])
    needed = _or_nan(identity.required_damping)
    yield Metric("theorem_1", "required_damping_at_identity", needed, "N m s/rad")
    left, promised = [], []
    for k1 in theory.learning_gains:
        # With B_f = I the floor lies at K2 = K1; another B_f moves it by its norm.
        gains = k1 * np.linalg.norm(fault, 2) * np.geomspace(0.01, 100.0, 41)
        for k2 in gains.tolist():
            least = certify(_HARDLY_ANY, fault, k1, k2).required_damping
            left.append(certify(_JUST_OUTSIDE * least, fault, k1, k2).dc_error)
        ample = certify(_AMPLE * least, fault, k1, k2)
        promised.append(ample.error_gain * (1 - k1))
    yield Metric("theorem_1", "least_constant_error", min(left), "1")
    yield Metric("theorem_1", "least_promised_error", min(promised), "1")
    unstable = [_unstable(body, *design) for design in _certified(theory, fault)]
    yield Metric("theorem_1", "unstable_share", float(np.mean(unstable)), "1")


def _certified(theory: keys.Theory, fault: Array) -> Iterator[tuple[float, Array, Array, float]]:
    """Random designs just inside what Theorem 1 certifies: Lambda, K1, K2, tau."""
    stream = random_stream(theory.random_seed, "ilo", "certified designs")
    for _ in range(theory.certified_designs):
        K1, K2 = stream.normal(size=(2, 3, 3))
        K1 *= stream.uniform(0.1, 0.98) / np.linalg.norm(K1, 2)
        K2 *= 10 ** stream.uniform(-2, 2)
        damping = _JUST_INSIDE * certify(_HARDLY_ANY, fault, K1, K2).required_damping
        yield damping, K1, K2, float(10 ** stream.uniform(-3, 0))


def _unstable(body: RigidBody, damping: float, K1: Array, K2: Array, interval: float) -> bool:
    law = LearningLaw(body.inertia, damping, body.fault_matrix, K1, K2, interval)
    return continuous_stability(law).verdict != "stable"


@part
def _certificates(job: Job) -> Iterator[Metric]:
    """Whether Theorem 1 certifies the observers of the figures, and the damping it asks for."""
    fault = known_body(job.plant).fault_matrix
    for name, observer in job.observers.items():
        if not isinstance(observer, keys.Adaptive):
            found = certify(observer.damping, fault, observer.K1, observer.K2)
            yield Metric(name, "certified", float(found.certified), "1")
            yield Metric(name, "required_damping", _or_nan(found.required_damping), "N m s/rad")


def _or_nan(value: float) -> float:
    return value if np.isfinite(value) else float("nan")
