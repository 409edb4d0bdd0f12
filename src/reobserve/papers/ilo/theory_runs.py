"""Runs under the stuck fault that no figure shows: other starts and rates, (13), (18)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.ilo_sampled import SampledILO
from reobserve.observers.rigid_body_observer import State
from reobserve.papers.ilo.body import known_body
from reobserve.papers.ilo.lyapunov import RepairedLyapunov
from reobserve.papers.ilo.reading import READINGS
from reobserve.papers.ilo.setup import stride
from reobserve.papers.ilo.theorem import bound18, certify
from reobserve.papers.ilo.theory_bench import Bench, rate_and_error
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.replication.metrics.responses import peak, root_mean_square_of_steps

_HARDLY_ANY = 1e-9  # a damping [N m s/rad] that is certified for no gains here


def measure(bench: Bench) -> Iterator[Metric]:
    """The numbers of `reobserve.papers.ilo.theory` that need runs under the stuck fault.

    Chen & Saif 2007, (13).

    Raises
    ------
    InputError
        If a value of the ledger cannot be used.
    DivergenceError
        If the plant or an observer diverges.
    """
    theory = bench.job.theory
    for name in READINGS:
        scores = list(_other_start(bench, name))
        yield from scores
        if name == theory.identity_reading:
            yield from (replace(score, observer="identity") for score in scores)
    yield from _adaptive(bench)
    yield from _slower(bench)
    yield from _lyapunov(bench)
    yield from _bound(bench)


@part
def _adaptive(bench: Bench) -> Iterator[Metric]:
    errors = bench.errors(bench.estimate("adaptive", bench.stuck), bench.stuck)
    yield Metric("adaptive", "late_relative_error_under_a_constant", bench.late(errors), "1")


@part
def _slower(bench: Bench) -> Iterator[Metric]:
    for factor in bench.job.theory.slowdowns:
        found = _slowed(bench, factor)
        yield Metric.at("sampled", ("relative_error", found, "1"), slowdown=factor)


@part
def _other_start(bench: Bench, name: str) -> Iterator[Metric]:
    """An observer that starts from another rate than the plant's: before and after the fault."""
    onset, window = bench.stuck.events["onsets"][0], bench.job.metrics.late_window
    start = bench.job.theory.start_rate
    estimate = bench.estimate(name, bench.stuck, initial_rate=start)
    before = (estimate.time > onset - window) & (estimate.time < onset - 1e-9)
    residual = peak(estimate["fault"][before], estimate["fault_before"][before])
    yield Metric(name, "residual_after_other_start", residual, "N m")
    late = bench.late(bench.errors(estimate, bench.stuck))
    yield Metric(name, "late_relative_error_after_other_start", late, "1")


def _slowed(bench: Bench, factor: float) -> float:
    """Relative error after the sampled observer has gone over to a longer interval.

    It learns until half-way between the onset and the end, and goes on from that state; nan if it
    then diverges.
    """
    job, plant = bench.job, bench.stuck
    observer, quick = job.observers["sampled"], bench.built["sampled"]
    every = stride(job.plant, quick)
    rate, control, fault = (plant[name][::every] for name in ("rate", "control", "fault"))
    onset, axis = plant.events["onsets"][0], job.metrics.axis - 1
    change = 2 * round(0.5 * (onset + float(plant.time[-1])) / quick.sampling_period)
    start = quick.init(observer.initial_rate, observer.initial_fault)
    state = run_on_halves(quick, rate[: change + 1], control[: change + 1], state=start).state
    slow = SampledILO(
        quick.model, observer.K1, observer.K2, observer.damping,
        factor * observer.update_interval, allow_unstable=True,
        sampling_period=quick.sampling_period,
    )  # fmt: skip
    run = run_on_halves(
        slow, rate[change:], control[change:],
        state=State(state.rate, state.memory), on_divergence="return",
    )  # fmt: skip
    if run.diverged_at is not None:
        return float("nan")
    truth = fault[change::2, axis]
    error = truth[:-1] - run["fault"][:-1, axis], truth[1:] - run.before["fault"][1:, axis]
    return root_mean_square_of_steps(*error) / root_mean_square_of_steps(truth[:-1], truth[1:])


@part
def _lyapunov(bench: Bench) -> Iterator[Metric]:
    """How (13) and its repair change over an interval under the stuck fault, K1 = I and d = 0."""
    job, plant = bench.job, bench.stuck
    observer = job.observers["continuous"]
    estimate = bench.estimate("continuous", plant)
    rates, errors = rate_and_error(plant, estimate)
    step, interval = estimate.step, observer.update_interval
    samples = round(interval / step)
    first = round(plant.events["onsets"][0] / step)
    last = first + round(job.theory.lyapunov_window / step)
    window = slice(first, last + 1)
    body = known_body(job.plant)
    gains = (body.inertia, observer.damping, body.fault_matrix, observer.K1, observer.K2)
    repaired = RepairedLyapunov(*gains, bench.eta)
    values = {"lyapunov_repaired": repaired.value(rates[window], errors[window], interval, samples)}
    squares = np.sum(errors[window] ** 2, axis=1)
    panels = np.append(0.0, np.cumsum((squares[1:] + squares[:-1]) / 2)) * step
    energy = np.einsum("ki,ij,kj->k", rates[window], body.inertia, rates[window])
    values["lyapunov_13"] = energy[samples:] + panels[samples:] - panels[:-samples]
    for name, value in values.items():
        # From one interval to the next at the same phase: within it quadrature shows, too.
        rises = value[samples:] / value[:-samples] - 1
        yield Metric(name, "rising_share", float(np.mean(rises > 0)), "1")
        yield Metric(name, "largest_rise", float(np.max(rises)), "1")


@part
def _bound(bench: Bench) -> Iterator[Metric]:
    """Both sides of (18) for a certified design under the stuck fault."""
    job, plant = bench.job, bench.stuck
    fault, K1 = known_body(job.plant).fault_matrix, job.theory.learning_gains[0]
    least = certify(_HARDLY_ANY, fault, K1, K1, bench.eta).required_damping
    design = certify(2 * least, fault, K1, K1, bench.eta)
    assert design.theorem is not None  # at twice the damping that is required
    observer = replace(job.observers["continuous"], K1=K1, K2=K1, damping=2 * least)
    estimate = bench.estimate_by(observer, plant)
    rates, errors = rate_and_error(plant, estimate)
    # The mismatch is largest just after the onset, when it is the fault itself.
    k_d = float(np.max(np.linalg.norm(plant["fault"], axis=1)))
    found = bound18(design.theorem, rates, errors, k_d)
    yield Metric("theorem_1", "bound_18_ratio", found.ratio, "1")
