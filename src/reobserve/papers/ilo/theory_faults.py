"""Runs of the ledger's observers under faults, noise and an inertia that no figure has."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from reobserve.core.random_streams import random_stream
from reobserve.core.validation import Terms
from reobserve.papers.ilo import keys
from reobserve.papers.ilo.body import known_body
from reobserve.papers.ilo.reading import READINGS
from reobserve.papers.ilo.scoring import scored
from reobserve.papers.ilo.theory_bench import Bench, rate_and_error
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.replication.parameters.job import named
from reobserve.signals.series import Series
from reobserve.synthesis.ilo_accuracy import matched_integrator


def measure(bench: Bench) -> Iterator[Metric]:
    """Errors under random faults, measurement noise and a wrong inertia; and of integral laws.

    Raises
    ------
    InputError
        If a value of the ledger cannot be used.
    DivergenceError
        If the plant or an observer diverges.
    """
    yield from _under_random_faults(bench)
    yield from _under_noise(bench)
    yield from _with_wrong_inertia(bench)
    yield from _by_adaptive_gain(bench)


@part
def _under_random_faults(bench: Bench) -> Iterator[Metric]:
    """Errors under random values that jump, and under the same joined by lines."""
    job, theory = bench.job, bench.job.theory
    begins, values = _random(theory, job.plant.horizon)
    jumping = bench.record(held(theory, begins, values, job.metrics.axis))
    joined = bench.record(lines(theory, begins, values, job.metrics.axis))
    first = joined.events["onsets"][0] + job.metrics.settling_skip
    for name in READINGS:
        yield from _under_jumps(bench, jumping, name)
        errors = bench.errors(bench.estimate(name, joined), joined).window(first)
        found = errors.relative_root_mean_square
        yield Metric(name, "relative_error_under_random_fault", found, "1")


@part
def _under_noise(bench: Bench) -> Iterator[Metric]:
    """Errors from noisy rates, also of the integrator with the gain of the reading's law."""
    job = bench.job
    noisy = bench.record(job.theory.aperiodic, noise=job.theory.noise)
    for name in READINGS:
        found = _scored(bench, bench.estimate(name, noisy), noisy)
        yield Metric(name, "relative_error_under_noise", found, "1")
    reading = job.observers[job.metrics.reading]
    gain = matched_integrator(reading.K2, reading.update_interval).integral_gain
    estimate = bench.estimate_by(_integral(bench, gain.tolist()), noisy)
    yield Metric("integral", "relative_error_under_noise", _scored(bench, estimate, noisy), "1")


@part
def _with_wrong_inertia(bench: Bench) -> Iterator[Metric]:
    """Errors of observers that are told another inertia."""
    job = bench.job
    aperiodic = bench.record(job.theory.aperiodic)
    for name in READINGS:
        observer = job.observers[name]
        factor = (1 + job.theory.inertia_error) * observer.inertia_factor
        estimate = bench.estimate_by(replace(observer, inertia_factor=factor), aperiodic)
        found = _scored(bench, estimate, aperiodic)
        yield Metric(name, "relative_error_with_wrong_inertia", found, "1")


@part
def _by_adaptive_gain(bench: Bench) -> Iterator[Metric]:
    """The error of the integral law with the greatest gain that is tried."""
    aperiodic = bench.record(bench.job.theory.aperiodic)
    estimate = bench.estimate_by(_integral(bench, bench.job.theory.adaptive_gain), aperiodic)
    yield Metric("integral", "relative_error", _scored(bench, estimate, aperiodic), "1")


def _random(theory: keys.Theory, horizon: float) -> tuple[list[float], list[float]]:
    """When a random fault takes a new normal value, every ``jump_hold``, and which."""
    stream = random_stream(theory.random_seed, "ilo", "jumping fault")
    hold = theory.jump_hold
    begins = hold * np.arange(1, int(np.ceil(horizon / hold - 1e-9)))
    sizes = theory.jump_size * stream.standard_normal(len(begins))
    return begins.tolist(), sizes.tolist()


def held(theory: keys.Theory, begins: list[float], values: list[float], axis: int) -> Terms:
    """A fault that holds each value until the next."""
    hold = theory.jump_hold
    return [
        {"kind": "constant", "axis": axis, "from": begin, "until": begin + hold, "size": value}
        for begin, value in zip(begins, values, strict=True)
    ]


def lines(theory: keys.Theory, begins: list[float], values: list[float], axis: int) -> Terms:
    """A fault that runs straight from zero to the first value and from each to the next."""
    hold = theory.jump_hold
    terms = held(theory, begins, [0.0, *values[:-1]], axis)
    for begin, start, end in zip(begins, [0.0, *values[:-1]], values, strict=True):
        when = {"axis": axis, "from": begin, "until": begin + hold}
        terms.append({"kind": "ramp", **when, "slope": (end - start) / hold})
    return terms


def _under_jumps(bench: Bench, jumping: Series, name: str) -> Iterator[Metric]:
    """Errors between jumps, once each has settled, and of the rate throughout."""
    theory = bench.job.theory
    onsets = jumping.events["onsets"]
    first = onsets[0] + bench.job.metrics.settling_skip
    estimate = bench.estimate(name, jumping)
    skip = theory.jump_settling * theory.jump_hold
    errors = scored(bench.errors(estimate, jumping), onsets, skip).window(first)
    found = errors.relative_root_mean_square
    yield Metric(name, "relative_error_between_jumps", found, "1")
    kept = estimate.time > first - 1e-9
    rates, _ = rate_and_error(jumping, estimate)
    true = jumping["rate"][:: round(estimate.step / jumping.step)]
    rate = float(np.linalg.norm(rates[kept]) / np.linalg.norm(true[kept]))
    yield Metric(name, "relative_rate_error_under_jumps", rate, "1")


def _scored(bench: Bench, estimate: Series, record: Series) -> float:
    """The relative error by the windows of the figures."""
    skip = bench.job.metrics.settling_skip
    errors = scored(bench.errors(estimate, record), record.events["onsets"], skip)
    return errors.relative_root_mean_square


def _integral(bench: Bench, gain: object) -> keys.Adaptive:
    """The integral law of this gain, with the Lambda that damps axis 1 as the ledger asks."""
    job = bench.job
    axis = job.metrics.axis - 1
    body = known_body(job.plant)
    inertia = body.inertia[axis, axis]
    adaptive: keys.Adaptive = named(job.observers, "adaptive", keys.Adaptive)
    stiffness = np.asarray(gain, dtype=np.float64)
    size = float(stiffness[axis, axis] if stiffness.ndim == 2 else stiffness)
    size *= float(body.fault_matrix[axis, axis])
    damping = 2.0 * job.theory.damping_ratio * float(np.sqrt(size * inertia))
    return replace(adaptive, integral_gain=gain, proportional_gain=0.0, damping=damping)
