"""Runs that no figure shows: other faults, starts, rates of updating, noise, and inertia."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from reobserve.core.random_streams import random_stream
from reobserve.core.validation import Terms
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.ilo_sampled import SampledILO
from reobserve.observers.rigid_body_observer import State
from reobserve.papers.ilo import keys
from reobserve.papers.ilo.body import known_body
from reobserve.papers.ilo.lyapunov import gyroscopic_eta, lyapunov_values, repaired_weights
from reobserve.papers.ilo.metrics import LEARNING
from reobserve.papers.ilo.observe import observe
from reobserve.papers.ilo.plant import simulate
from reobserve.papers.ilo.scoring import Errors, scored, scored_errors
from reobserve.papers.ilo.setup import build_observer, pure_integrator, stride
from reobserve.papers.ilo.theorem import bound18, certify
from reobserve.replication.metrics.metrics import Metric
from reobserve.replication.metrics.parts import part
from reobserve.replication.metrics.responses import peak, root_mean_square_of_steps
from reobserve.replication.parameters.job import Job
from reobserve.signals.series import Series
from reobserve.synthesis.ilo_accuracy import matched_integrator

Array = NDArray[np.float64]

NEEDED = {**keys.VARIANTS, "adaptive": keys.Adaptive}  # observers, by name and form


@dataclass(frozen=True)
class Runs:
    """The observers of a job, whose plant has no noise, and the record of the stuck fault."""

    job: Job
    stuck: Series

    @classmethod
    def of(cls, job: Job) -> Runs:
        """Simulate the stuck fault."""
        plant = replace(job.plant, noise=0.0)
        return cls(replace(job, plant=plant), _record(plant, job.theory.stuck, 0))

    def record(self, fault: Terms, noise: float = 0.0) -> Series:
        """The plant under another fault, measured with noise of this standard deviation."""
        plant = replace(self.job.plant, noise=noise)
        return _record(plant, fault, self.job.theory.random_seed)

    def estimate(self, observer: keys.Observer, record: Series) -> Series:
        """By an observer of the parameter file, or a change of one."""
        built = build_observer(self.job.plant, observer)
        return observe(built, Job(self.job.plant, observer=observer), record)

    def errors(self, estimate: Series, record: Series) -> Errors:
        """Of the fault on the faulty axis."""
        return Errors.of(record, estimate, self.job.metrics.axis - 1)

    def relative_error(self, observer: keys.Observer, record: Series) -> float:
        """By the windows of the figures."""
        errors = scored_errors(self.job, record, self.estimate(observer, record))
        return errors.relative_root_mean_square

    def late(self, estimate: Series) -> float:
        """Relative error under the stuck fault in the last window of the run."""
        first = float(self.stuck.time[-1]) - self.job.metrics.late_window
        return self.errors(estimate, self.stuck).window(first).relative_root_mean_square

    @property
    def learning(self) -> keys.Learning:
        """The variant of (3) that the parameter file names."""
        found: keys.Learning = self.job.observers[self.job.metrics.reading]
        return found

    @property
    def eta(self) -> float:
        """The constant [N m s] that Assumption 2 needs on the record."""
        inertia = known_body(self.job.plant).inertia
        return gyroscopic_eta(inertia, float(np.max(np.linalg.norm(self.stuck["rate"], axis=1))))


def _record(plant: keys.Plant, fault: Terms, seed: int) -> Series:
    return _simulated(json.dumps([asdict(plant), fault, seed]))


@lru_cache(maxsize=8)
def _simulated(stated: str) -> Series:
    """Records stay as they are while gains are drawn, which is done many times."""
    plant, fault, seed = json.loads(stated)
    return simulate(Job(keys.Plant(**plant), seed, scenario=keys.Scenario(fault)))


def measure(job: Job) -> Iterator[Metric]:
    """The numbers of `reobserve.papers.ilo.theory` that need runs.

    Raises
    ------
    InputError
        If a parameter value cannot be used.
    DivergenceError
        If the plant or an observer diverges.
    """
    runs = Runs.of(job)
    yield from _other_start(runs)
    yield from _from_other_start_with_identity(runs)
    yield from _adaptive(runs)
    yield from _slower(runs)
    yield from _lyapunov(runs)
    yield from _bound(runs)
    yield from _under_random_faults(runs)
    yield from _under_noise(runs)
    yield from _with_wrong_inertia(runs)
    yield from _by_adaptive_gain(runs)


@part
def _other_start(runs: Runs) -> Iterator[Metric]:
    """The observer starts from another rate than the plant: before and after the fault."""
    onset, window = runs.stuck.events["onsets"][0], runs.job.metrics.late_window
    estimate = _started(runs, runs.job.metrics.reading)
    before = (estimate.time > onset - window) & (estimate.time < onset - 1e-9)
    residual = peak(estimate["fault"][before], estimate["fault_before"][before])
    yield Metric(LEARNING, "residual_after_other_start", residual, "N m")
    late = runs.late(estimate)
    yield Metric(LEARNING, "late_relative_error_after_other_start", late, "1")


@part
def _from_other_start_with_identity(runs: Runs) -> Iterator[Metric]:
    late = runs.late(_started(runs, runs.job.theory.identity_reading))
    yield Metric("identity", "late_relative_error_after_other_start", late, "1")


def _started(runs: Runs, name: str) -> Series:
    start = runs.job.theory.start_rate
    return runs.estimate(replace(runs.job.observers[name], initial_rate=start), runs.stuck)


@part
def _adaptive(runs: Runs) -> Iterator[Metric]:
    late = runs.late(runs.estimate(runs.job.observers["adaptive"], runs.stuck))
    yield Metric("adaptive", "late_relative_error_under_a_constant", late, "1")


@part
def _slower(runs: Runs) -> Iterator[Metric]:
    for factor in runs.job.theory.slowdowns:
        found = _slowed(runs, factor)
        yield Metric.at("sampled", ("relative_error", found, "1"), slowdown=factor)


def _slowed(runs: Runs, factor: float) -> float:
    """Relative error after the sampled observer has gone over to a longer interval.

    It learns until half-way between the onset and the end, and goes on from that state; nan if it
    then diverges.
    """
    job, plant = runs.job, runs.stuck
    observer = job.observers["sampled"]
    quick = build_observer(job.plant, observer)
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
def _lyapunov(runs: Runs) -> Iterator[Metric]:
    """How (13) and its repair change over an interval under the stuck fault, K1 = I and d = 0."""
    job, plant = runs.job, runs.stuck
    observer = job.observers["continuous"]
    estimate = runs.estimate(observer, plant)
    rates, errors = rate_and_error(plant, estimate)
    samples = round(observer.update_interval / estimate.step)
    first = round(plant.events["onsets"][0] / estimate.step)
    window = slice(first, first + round(job.theory.lyapunov_window / estimate.step) + 1)
    body = known_body(job.plant)
    _, repaired = repaired_weights(body.fault_matrix, observer.K1, observer.K2)
    weights = {"lyapunov_repaired": repaired, "lyapunov_13": np.eye(3)}
    for name, weight in weights.items():
        value = lyapunov_values(
            body.inertia, weight, rates[window], errors[window], observer.update_interval, samples
        )
        # From one interval to the next at the same phase: within it quadrature shows, too.
        rise = float(np.max(value[samples:] / value[:-samples] - 1))
        yield Metric(name, "largest_rise", rise, "1")


@part
def _bound(runs: Runs) -> Iterator[Metric]:
    """Both sides of (18) for a certified design under the stuck fault."""
    job, plant = runs.job, runs.stuck
    fault, K1 = known_body(job.plant).fault_matrix, job.theory.learning_gains[0]
    least = certify(1.0, fault, K1, K1, runs.eta).required_damping
    design = certify(2 * least, fault, K1, K1, runs.eta)
    assert design.theorem is not None  # at twice the Lambda that is required
    observer = replace(job.observers["continuous"], K1=K1, K2=K1, damping=2 * least)
    rates, errors = rate_and_error(plant, runs.estimate(observer, plant))
    # The mismatch is largest just after the onset, when it is the fault itself.
    k_d = float(np.max(np.linalg.norm(plant["fault"], axis=1)))
    left, right = bound18(design.theorem, rates, errors, k_d)
    yield Metric("theorem_1", "bound_18_ratio", right / left, "1")


@part
def _under_random_faults(runs: Runs) -> Iterator[Metric]:
    """Errors under random values that jump, and under the same joined by lines.

    They are the least of all variants, each at the shortest interval.
    """
    job, theory = runs.job, runs.job.theory
    begins, values = random_values(theory, job.plant.horizon)
    jumping = runs.record(held(theory, begins, values, job.metrics.axis))
    joined = runs.record(lines(theory, begins, values, job.metrics.axis))
    onsets = jumping.events["onsets"]
    first = onsets[0] + job.metrics.settling_skip
    shortest = min(theory.intervals)
    designs = [replace(job.observers[name], update_interval=shortest) for name in keys.VARIANTS]

    def least(record: Series, skip: float) -> float:
        errors = (runs.errors(runs.estimate(design, record), record) for design in designs)
        parts = (scored(one, onsets, skip) if skip else one for one in errors)
        return min(one.window(first).relative_root_mean_square for one in parts)

    found = least(jumping, theory.jump_settling * theory.jump_hold)
    yield Metric("best", "relative_error_between_jumps", found, "1")
    yield Metric("best", "relative_error_under_random_fault", least(joined, 0.0), "1")


@part
def _under_noise(runs: Runs) -> Iterator[Metric]:
    """Errors from noisy rates, also of the integrator with the gain of the sampled variant."""
    theory, sampled = runs.job.theory, runs.job.observers["sampled"]
    noisy = runs.record(theory.aperiodic, noise=theory.noise)
    gain = matched_integrator(sampled.K2, sampled.update_interval).integral_gain
    integral = pure_integrator(runs.job, gain.tolist(), theory.damping_ratio)
    for name, observer in (("sampled", sampled), ("integral", integral)):
        found = runs.relative_error(observer, noisy)
        yield Metric(name, "relative_error_under_noise", found, "1")


@part
def _with_wrong_inertia(runs: Runs) -> Iterator[Metric]:
    """Error of an observer that has another inertia than the plant."""
    theory, observer = runs.job.theory, runs.learning
    factor = (1 + theory.inertia_error) * observer.inertia_factor
    wrong = replace(observer, inertia_factor=factor)
    found = runs.relative_error(wrong, runs.record(theory.aperiodic))
    yield Metric(LEARNING, "relative_error_with_wrong_inertia", found, "1")


@part
def _by_adaptive_gain(runs: Runs) -> Iterator[Metric]:
    """The error of a pure integrator with the gain that is tried."""
    theory = runs.job.theory
    integral = pure_integrator(runs.job, theory.adaptive_gain, theory.damping_ratio)
    found = runs.relative_error(integral, runs.record(theory.aperiodic))
    yield Metric("integral", "relative_error", found, "1")


def random_values(theory: keys.Theory, horizon: float) -> tuple[list[float], list[float]]:
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


def rate_and_error(plant: Series, estimate: Series) -> tuple[Array, Array]:
    """w~ [rad/s] and e [N m] on all axes at the steps of the estimate."""
    every = round(estimate.step / plant.step)
    return (
        plant["rate"][::every] - estimate["rate"],
        plant["fault"][::every] - estimate["fault"],
    )
