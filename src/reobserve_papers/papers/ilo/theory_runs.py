"""Runs that are not in the figures: other faults, starts, updating rates, noise and inertia."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from reobserve.core.validation import Terms
from reobserve.observers.fixed_step import run_on_halves
from reobserve.observers.ilo import SampledILO
from reobserve.observers.rigid_body_observer import RigidBodyState
from reobserve.synthesis.ilo_accuracy import matched_integrator
from reobserve.synthesis.ilo_certificate import bound18, certify
from reobserve_papers.metrics.metrics import Metric
from reobserve_papers.metrics.responses import peak, root_mean_square_of_steps
from reobserve_papers.metrics.theory_parts import part
from reobserve_papers.papers.ilo import keys
from reobserve_papers.papers.ilo.body import known_body
from reobserve_papers.papers.ilo.metrics import LEARNING
from reobserve_papers.papers.ilo.observe import observe
from reobserve_papers.papers.ilo.plant import simulate
from reobserve_papers.papers.ilo.scoring import Errors, scored_errors
from reobserve_papers.papers.ilo.setup import build_observer, pure_integrator, stride
from reobserve_papers.parameters.job import named
from reobserve_papers.signals.random_streams import random_stream
from reobserve_papers.signals.series import Channel, Series

Array = NDArray[np.float64]

_FASTEST = 0.01  # [s] between the values of the fastest fault, the opening time of a small valve

NEEDED = {**keys.VARIANTS, "adaptive": keys.Adaptive}  # the type of each observer


@dataclass(frozen=True)
class Runs:
    """A job with a plant without noise, and its record of the stuck fault."""

    job: keys.Job
    stuck: Series

    @classmethod
    def of(cls, job: keys.Job) -> Runs:
        """Simulate the stuck fault."""
        plant = replace(job.plant, noise=0.0)
        return cls(replace(job, plant=plant), _record(plant, job.theory.stuck, 0))

    def record(self, fault: Terms, noise: float = 0.0) -> Series:
        """Simulate the plant under another fault. ``noise`` is a standard deviation [rad/s]."""
        plant = replace(self.job.plant, noise=noise)
        return _record(plant, fault, self.job.theory.random_seed)

    def estimate(self, observer: keys.Observer, record: Series) -> Series:
        """Run an observer of the parameter file, or a changed one."""
        built = build_observer(self.job.plant, observer)
        return observe(built, keys.Job(self.job.plant, observer=observer), record)

    def errors(self, estimate: Series, record: Series) -> Errors:
        """Errors of the fault on the faulty axis."""
        return Errors.of(record, estimate, self.job.metrics.axis - 1)

    def relative_error(self, observer: keys.Observer, record: Series) -> float:
        """Relative RMS error over the windows of the figures."""
        errors = scored_errors(self.job, record, self.estimate(observer, record))
        return errors.relative_root_mean_square

    def late_errors(self, estimate: Series) -> Errors:
        """Errors under the stuck fault in the last window of the run."""
        first = float(self.stuck.time[-1]) - self.job.metrics.late_window
        return self.errors(estimate, self.stuck).scored("metrics.late_window", first)

    def late(self, estimate: Series) -> float:
        """Relative error under the stuck fault in the last window of the run."""
        return self.late_errors(estimate).relative_root_mean_square

    @property
    def learning(self) -> keys.Learning:
        """The variant of (3) that the parameter file names."""
        return self.variant(self.job.metrics.variant)

    def variant(self, name: str) -> keys.Learning:
        """A variant of (3) by its name."""
        return named(self.job.observers, name, keys.VARIANTS[name])

    @property
    def eta(self) -> float:
        """The constant [N m s] of Assumption 2 for the record."""
        inertia = known_body(self.job.plant).inertia
        return gyroscopic_eta(inertia, float(np.max(np.linalg.norm(self.stuck["rate"], axis=1))))


def gyroscopic_eta(inertia: Array, rate_bound: float) -> float:
    """The one-sided constant (J_max - J_min) / 2 * max |w| [N m s].

    Chen & Saif 2007, Assumption 2.

    The torque difference of Assumption 2 is quadratic in w~, so it has no global eta. The proof
    needs only its component along w~. With w^ = w - w~, the error equation contains
    g = -w x J w + w^ x J w^ = -w x J w~ - w~ x J w + w~ x J w~, so w~.g = -w~.(w x J w~). A
    multiple c I of the identity adds nothing to J there, and c = (J_max + J_min) / 2 gives
    |w~.g| <= |w| ||J - c I|| |w~|^2, with equality between the extreme principal axes.
    """
    moments = np.linalg.eigvalsh(inertia)
    return float((moments[-1] - moments[0]) / 2 * rate_bound)


def _record(plant: keys.Plant, fault: Terms, seed: int) -> Series:
    return _simulated(json.dumps([asdict(plant), fault, seed]))


@lru_cache(maxsize=8)
def _simulated(stated: str) -> Series:
    """Simulate a record, cached, since sampling varies the gains many times."""
    plant, fault, seed = json.loads(stated)
    return simulate(keys.Job(keys.Plant(**plant), seed, scenario=keys.Scenario(fault)))


def measure(job: keys.Job) -> Iterator[Metric]:
    """Compute the numbers of `reobserve_papers.papers.ilo.theory` that need runs."""
    runs = Runs.of(job)
    yield from _stuck(runs)
    yield from _other_start(runs)
    yield from _from_other_start_with_identity(runs)
    yield from _adaptive(runs)
    yield from _slower(runs)
    yield from _bound(runs)
    yield from _under_random_faults(runs)
    yield from _under_the_fastest_fault(runs)
    yield from _with_larger_gains(runs)
    yield from _under_noise(runs)
    yield from _with_wrong_inertia(runs)
    yield from _by_adaptive_gain(runs)


@part
def _stuck(runs: Runs) -> Iterator[Metric]:
    """Range of the command, which a stuck thruster ignores, from the onset on.

    What (2) adds to the command u_1 is then the stuck torque minus u_1.
    """
    axis = runs.job.metrics.axis - 1
    stuck = runs.stuck.time >= runs.stuck.events["onsets"][0]
    ignored = np.ptp(runs.stuck["control"][stuck, axis]) / peak(runs.stuck["fault"][:, axis])
    yield Metric("stuck", "command_range", float(ignored), "1")


@part
def _other_start(runs: Runs) -> Iterator[Metric]:
    """Errors before and after the fault if the observer starts from a wrong rate."""
    onset, window = runs.stuck.events["onsets"][0], runs.job.metrics.late_window
    estimate = _started(runs, runs.job.metrics.variant)
    before = (estimate.time > onset - window) & (estimate.time < onset - 1e-9)
    residual = peak(estimate["fault"][before], estimate["fault_before"][before])
    yield Metric(LEARNING, "residual_after_other_start", residual, "N m")
    late = runs.late(estimate)
    yield Metric(LEARNING, "late_relative_error_after_other_start", late, "1")


@part
def _from_other_start_with_identity(runs: Runs) -> Iterator[Metric]:
    """The last window in two norms, and over the first one."""
    estimate = _started(runs, runs.job.theory.identity_variant)
    late, name = runs.late_errors(estimate), "late_relative_error_after_other_start"
    yield Metric("identity", name, late.relative_root_mean_square, "1")
    yield Metric.at("identity", (name, late.relative("largest"), "1"), norm="largest")
    first = runs.errors(estimate, runs.stuck).window(0.0, runs.job.metrics.late_window)
    left = late.root_mean_square / first.root_mean_square
    yield Metric("identity", "error_left_after_other_start", left, "1")


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
        error = _slowed(runs, factor)
        yield Metric.at("sampled", ("relative_error", error, "1"), slowdown=factor)


def _slowed(runs: Runs, factor: float) -> float:
    """Relative error after the sampled observer changes to a longer interval.

    It changes half-way between the onset and the end, and keeps its state; nan if it then diverges.
    """
    job, plant = runs.job, runs.stuck
    observer = runs.variant("sampled")
    quick = build_observer(job.plant, observer)
    every = stride(job.plant, quick)
    rate, control, fault = (plant[name][::every] for name in ("rate", "control", "fault"))
    onset, axis = plant.events["onsets"][0], job.metrics.axis - 1
    change = 2 * round(0.5 * (onset + float(plant.time[-1])) / quick.sampling_period)
    start = quick.init(observer.initial_rate, fault=observer.initial_fault)
    state = run_on_halves(quick, rate[: change + 1], control[: change + 1], start=start).end
    slow = SampledILO(
        quick.model, K1=observer.K1, K2=observer.K2, observer_gain=observer.observer_gain,
        update_interval=factor * observer.update_interval, allow_unstable=True,
        sampling_period=quick.sampling_period,
    )  # fmt: skip
    run = run_on_halves(
        slow, rate[change:], control[change:],
        start=RigidBodyState(state.rate, state.memory), on_divergence="return",
    )  # fmt: skip
    if run.diverged_at is not None:
        return float("nan")
    truth = fault[change::2, axis]
    error = truth[:-1] - run["fault"][:-1, axis], truth[1:] - run.before["fault"][1:, axis]
    return root_mean_square_of_steps(*error) / root_mean_square_of_steps(truth[:-1], truth[1:])


@part
def _bound(runs: Runs) -> Iterator[Metric]:
    """Both sides of (18) for a certified design under the stuck fault."""
    job, plant = runs.job, runs.stuck
    fault, K1 = known_body(job.plant).fault_matrix, job.theory.learning_gains[0]
    least = certify(1.0, fault, K1, K1, runs.eta).required_observer_gain
    design = certify(2 * least, fault, K1, K1, runs.eta)
    assert design.theorem is not None  # at twice the Lambda that is required
    observer = replace(runs.variant("continuous"), K1=K1, K2=K1, observer_gain=2 * least)
    rates, errors = rate_and_error(plant, runs.estimate(observer, plant))
    # The mismatch is largest just after the onset, when it is the fault itself.
    k_d = float(np.max(np.linalg.norm(plant["fault"], axis=1)))
    left, right = bound18(design.theorem, rates, errors, k_d)
    yield Metric("theorem_1", "bound_18_ratio", right / left, "1")


@part
def _under_random_faults(runs: Runs) -> Iterator[Metric]:
    """Minimum error of all variants under a random fault, and the error of an integrator.

    The variants have the shortest interval and the largest K2.
    """
    theory = runs.job.theory
    gain, interval = theory.largest_gain, min(theory.intervals)
    variants = [
        replace(runs.variant(name), K2=gain, update_interval=interval) for name in keys.VARIANTS
    ]
    error = min(_error_under_random_fault(runs, variant) for variant in variants)
    yield Metric("best", "relative_error_under_random_fault", error, "1")
    integral = pure_integrator(runs.job, theory.adaptive_gain, theory.damping_ratio)
    error = _error_under_random_fault(runs, integral)
    yield Metric("integral", "relative_error_under_random_fault", error, "1")


@part
def _under_the_fastest_fault(runs: Runs) -> Iterator[Metric]:
    """Error of an integrator under a random fault that is as fast as the torque can be."""
    theory = runs.job.theory
    integral = pure_integrator(runs.job, theory.adaptive_gain, theory.damping_ratio)
    error = _error_under_random_fault(runs, integral, _FASTEST)
    score = ("relative_error_under_random_fault", error, "1")
    yield Metric.at("integral", score, fault="fastest")


@part
def _with_larger_gains(runs: Runs) -> Iterator[Metric]:
    """Error under a random fault with K1 = I, beyond the ranges of K2 and tau."""
    continuous = runs.variant("continuous")
    gain, interval = 10 * runs.job.theory.largest_gain, continuous.sampling_period
    beyond = replace(continuous, K1=1.0, K2=gain, update_interval=interval)
    score = ("relative_error_under_random_fault", _error_under_random_fault(runs, beyond), "1")
    yield Metric.at("best", score, gains="larger")


def _error_under_random_fault(
    runs: Runs, observer: keys.Observer, spacing: float | None = None
) -> float:
    """Relative RMS error after the first second, with ``spacing`` [s] between random values."""
    job = runs.job
    theory = job.theory if spacing is None else replace(job.theory, fault_spacing=spacing)
    record = runs.record(random_fault(theory, job.plant.horizon, job.metrics.axis))
    first = record.events["onsets"][0] + job.metrics.settling_skip
    errors = runs.errors(runs.estimate(observer, record), record)
    return errors.scored("metrics.settling_skip", first).relative_root_mean_square


@part
def _under_noise(runs: Runs) -> Iterator[Metric]:
    """Errors under noise of the sampled variant, and of the integrator with the same gain."""
    theory, sampled = runs.job.theory, runs.variant("sampled")
    noisy = runs.record(theory.aperiodic, noise=theory.noise)
    gain = matched_integrator(sampled.K2, sampled.update_interval).integral_gain
    integral = pure_integrator(runs.job, gain.tolist(), theory.damping_ratio)
    for name, observer in (("sampled", sampled), ("integral", integral)):
        error = runs.relative_error(observer, noisy)
        yield Metric(name, "relative_error_under_noise", error, "1")


@part
def _with_wrong_inertia(runs: Runs) -> Iterator[Metric]:
    """Errors of torque and rate of an observer with a wrong inertia."""
    theory, observer = runs.job.theory, runs.learning
    factor = (1 + theory.inertia_error) * observer.inertia_factor
    record = runs.record(theory.aperiodic)
    estimate = runs.estimate(replace(observer, inertia_factor=factor), record)
    errors = scored_errors(runs.job, _lumped(runs.job.plant, record, factor), estimate)
    error = errors.relative_root_mean_square
    yield Metric(LEARNING, "relative_error_with_wrong_inertia", error, "1")
    rates, _ = rate_and_error(record, estimate)
    error = float(np.linalg.norm(rates) / np.linalg.norm(rates + estimate["rate"]))
    yield Metric(LEARNING, "relative_rate_error_with_wrong_inertia", error, "1")


def _lumped(plant: keys.Plant, record: Series, factor: float) -> Series:
    """The record with the torque that a wrong inertia causes added to the fault."""
    # J^ = c J:  J^ w' = -w x J^ w + B u + B_f f  with  f = c u_f + (c - 1) B_f^-1 B u
    body, channels = known_body(plant), dict(record.channels)
    added = (factor - 1) * (np.linalg.pinv(body.fault_matrix) @ body.input_matrix).T
    for end in ("", "_before"):
        fault, control = (
            record.channels.get(name + end, record.channels[name]).values
            for name in ("fault", "control")
        )
        channels[f"fault{end}"] = Channel(factor * fault + control @ added, "N m")
    return Series(record.time, channels, record.events)


@part
def _by_adaptive_gain(runs: Runs) -> Iterator[Metric]:
    """Error of a pure integrator with the given gain."""
    theory = runs.job.theory
    integral = pure_integrator(runs.job, theory.adaptive_gain, theory.damping_ratio)
    error = runs.relative_error(integral, runs.record(theory.aperiodic))
    yield Metric("integral", "relative_error", error, "1")


def random_fault(theory: keys.Theory, horizon: float, axis: int) -> Terms:
    """A fault of straight lines from zero through normally distributed values."""
    stream = random_stream(theory.random_seed, "ilo", "random fault")
    spacing = theory.fault_spacing
    begins = spacing * np.arange(1, int(np.ceil(horizon / spacing - 1e-9)))
    values = np.append(0.0, theory.fault_size * stream.standard_normal(len(begins))).tolist()
    terms = []
    for begin, (start, end) in zip(begins.tolist(), pairwise(values), strict=True):
        when = {"axis": axis, "from": begin, "until": begin + spacing}
        terms.append({"kind": "constant", **when, "size": start})
        terms.append({"kind": "ramp", **when, "slope": (end - start) / spacing})
    return terms


def rate_and_error(plant: Series, estimate: Series) -> tuple[Array, Array]:
    """w~ [rad/s] and e [N m] on all axes at the steps of the estimate."""
    every = round(estimate.step / plant.step)
    return (
        plant["rate"][::every] - estimate["rate"],
        plant["fault"][::every] - estimate["fault"],
    )
