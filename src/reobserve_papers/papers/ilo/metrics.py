"""Stage metrics: errors of the estimated fault, detection delays, and predictions of theory.

e is the fault torque minus its estimate on the faulty axis. Errors are measured from one second
(`metrics.settling_skip`) after each onset. `nan` marks what never happens or does not exist. The
observer `learning` is the variant of (3) that `metrics.variant` names. The lower part of the table
holds the numbers of the theory, in `theory.metrics.csv`. There the observer column may name another
subject: `identity` is the variant with K1 = I that `theory.identity_variant` names, `best` the
variant with the minimum error, `integral` an integrator. Two estimates know nothing of the fault's
course: `zero` is always zero, `mean` is the mean of the fault. The stuck fault is that of Fig. 1,
and an interval is tau.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve.synthesis.ilo_accuracy import pi_error_transfer, predicted_rms_error
from reobserve.synthesis.ilo_error_system import LearningLaw
from reobserve_papers.metrics.metrics import Metric, Score, scores_of
from reobserve_papers.metrics.responses import first_crossing, peak, settling_time
from reobserve_papers.papers.ilo import keys
from reobserve_papers.papers.ilo.body import known_body
from reobserve_papers.papers.ilo.scoring import NORMS, Errors, scored_errors
from reobserve_papers.parameters.figure_data import FigureData

# By layout of a figure: what its numbers are of, beside observers.
SUBJECTS = {
    "estimation": "learning mean zero",
    "matching": "learning mean zero ilo integral proportional_integral",
    "theory": "assumption_2 best identity integral learning lemma_1 stuck theorem_1 zero",
}

# The meaning of each number, including those of the theory; `<word>` is a placeholder.
MEANINGS = {
    "rms_error": "root mean square of e",
    "relative_rms_error": "the same, divided by that of the fault",
    "relative_error norm=<rms,absolute,largest> window=<onset,settled>": (
        "e over the fault, by root mean squares (rms), mean absolute values (absolute) or largest "
        "values (largest); from the first onset on (onset), or without what follows each (settled)"
    ),
    "late_rms_error": "root mean square of e in the last second",
    "residual_before_fault": "largest estimate on any axis before the first onset",
    "detection_delay": "from the first onset until the estimate exceeds the threshold",
    "settling_time": "from the last onset until |e| stays below the threshold",
    "predicted_rms_error": "`rms_error` in steady state, predicted by linear theory",
    "relative_rms_error <sweep>=<level>": "mean over the runs of a study at one level",
    "violations": "random cases in which (5) of Lemma 1 fails",
    "violations_without_mismatch": "the same for (12)",
    "required_observer_gain_at_identity": "minimum Lambda with which Theorem 1 certifies K1 = I",
    "minimum_constant_error": (
        "minimum share of a constant fault that certified designs do not estimate"
    ),
    "unstable_share": "share of random certified designs that are unstable",
    "bound_18_ratio": (
        "right side of (18) over the left, for a certified design under the stuck fault"
    ),
    "gain_margin multiple=<multiple>": (
        "largest stable K2 over K2, with v updated at a multiple of the interval"
    ),
    "noise_gain multiple=<multiple>": (
        "standard deviation of v over that of rate noise drawn at each update and held"
    ),
    "growth_of_the_constant side=<one,two>": (
        "constant of Assumption 2 for errors ten times as large, over the constant: of the whole "
        "torque (two), or of its component along the error (one)"
    ),
    "command_range": (
        "how much the command of a stuck thruster varies from the onset on, over the stuck torque"
    ),
    "gaps": "steps of the printed proof that a counterexample refutes",
    "certified": "1 if Theorem 1 certifies the gains, 0 if not",
    "sine_error_over rival=<integrator,none,proportional_integral>": (
        "amplitude of e under sin 10 t over that of a rival with the same K2 and tau: without "
        "learning (none), an integrator K2 / tau with the damping ratio of `theory.damping_ratio` "
        "(integrator), or with a proportional part K2 / 2 (proportional_integral)"
    ),
    "worst_round_gain": "largest factor of an error from one interval to the next",
    "sine_error interval=<interval>": "amplitude of e over that of sin 10 t, linear theory",
    "largest_interval frequency=<frequency>": (
        "longest interval that keeps it below 5 %, half a period at most"
    ),
    "distance_from_integrator": (
        "relative distance of the transfer to e under sin 10 t from that of the integrator "
        "K2 / tau, without or with a proportional part K2 / 2"
    ),
    "disturbance_gain": "maximum gain from a high-frequency torque to the estimate",
    "operations": "multiplications and additions of the estimation law per sampling period",
    "residual_after_other_start": (
        "largest estimate in the second before the fault, if the observer starts from a wrong rate"
    ),
    "late_relative_error_after_other_start": (
        "root mean square of e over the fault in the last second of that run"
    ),
    "late_relative_error_after_other_start norm=largest": "the same by largest values",
    "error_left_after_other_start": (
        "root mean square of e in the last second of that run over that in the first"
    ),
    "late_relative_error_under_a_constant": (
        "the same of the adaptive observer under the stuck fault"
    ),
    "relative_error slowdown=<factor>": "the same after updates become rarer by a factor",
    "relative_error": "root mean square of e over that of the aperiodic fault, with an integrator",
    "relative_error_under_random_fault": "the same for a fault that joins random values by lines",
    "relative_error_under_random_fault fault=fastest": (
        "the same with 10 ms between the random values"
    ),
    "relative_error_under_random_fault gains=larger": (
        "the same with ten times the largest K2 and tau of one sampling period, K1 = I"
    ),
    "relative_error_under_noise": "the same for the aperiodic fault, measured with noise",
    "relative_error_with_wrong_inertia": (
        "the same without noise, with a wrong inertia, whose torque counts as part of the fault"
    ),
    "relative_rate_error_with_wrong_inertia": (
        "root mean square error of the rate over the root mean square of the rate, in the same run"
    ),
}

LEARNING = "learning"


def measure(data: FigureData[keys.Job]) -> Iterator[Metric]:
    """The numbers of a figure, observer by observer (see `MEANINGS`)."""
    scores = [metric for name in data.estimates for metric in scores_of(name, _scores(data, name))]
    yield from scores
    if keys.VARIANTS.keys() <= data.estimates.keys():
        named = (metric for metric in scores if metric.observer == data.job.metrics.variant)
        yield from (replace(metric, observer=LEARNING) for metric in named)
        yield from _relative_errors(data)
    score = "relative_rms_error"
    if data.study:  # the mean over the runs at each level
        for (observer, sweep, level), runs in data.study.groups("observer", "sweep", "level"):
            yield Metric.at(observer, (score, float(np.mean(runs[score])), "1"), **{sweep: level})


def _relative_errors(data: FigureData[keys.Job]) -> Iterator[Metric]:
    """Errors of the variant that is named and of constant guesses, in all norms and windows."""
    job, estimate = data.job, data.estimates[data.job.metrics.variant]
    for window, skip in (("settled", job.metrics.settling_skip), ("onset", 0.0)):
        errors = scored_errors(job, data.plant, estimate, skip)
        guesses = {
            LEARNING: errors,
            "zero": errors.guessed(0.0),
            "mean": errors.guessed(errors.mean_fault),
        }
        for name, guess in guesses.items():
            for norm in NORMS:
                score = ("relative_error", guess.relative(norm), "1")
                yield Metric.at(name, score, norm=norm, window=window)
    begin = float(estimate.time[-1]) - job.metrics.late_window
    late = Errors.of(data.plant, estimate, job.metrics.axis - 1).window(begin)
    yield Metric("zero", "late_rms_error", late.guessed(0.0).root_mean_square, "N m")


def _scores(data: FigureData[keys.Job], name: str) -> Iterator[Score]:
    job, plant, estimate = data.job, data.plant, data.estimates[name]
    rules = job.metrics
    axis = rules.axis - 1
    onsets = plant.events["onsets"]
    errors = Errors.of(plant, estimate, axis)
    score = scored_errors(job, plant, estimate)
    end = float(estimate.time[-1])
    late = errors.scored("metrics.late_window", end - rules.late_window)
    first = onsets[0] if onsets else end
    last = onsets[-1] if onsets else 0.0
    before = estimate.time < first - 1e-9
    time, v = estimate.time[~before], estimate["fault"][~before]
    v_before = estimate["fault_before"][~before]
    threshold = rules.residual_threshold

    yield "rms_error", score.root_mean_square, "N m"
    yield "relative_rms_error", score.relative_root_mean_square, "1"
    yield "late_rms_error", late.root_mean_square, "N m"
    yield "residual_before_fault", peak(estimate["fault"][before]), "N m"
    seen = first_crossing(time, v[:-1, axis], v_before[1:, axis], threshold)
    yield "detection_delay", seen - first, "s"
    after = errors.window(last)
    settled = settling_time(np.append(after.time, end), after.start, after.end, threshold)
    yield "settling_time", settled - last, "s"
    predicted = predicted_error(job, job.observers[name], axis)
    if predicted is not None:
        yield "predicted_rms_error", predicted, "N m"


def predicted_error(job: keys.Job, observer: keys.Observer, axis: int) -> float | None:
    """RMS of e on ``axis`` [N m] in steady state by linear theory, after the last onset.

    None if the fault is not a sum of constants and sines, or if the observer has a wrong inertia,
    because the gyroscopic and control torques then matter, too.
    """
    if observer.inertia_factor != 1.0 or any(
        term["kind"] not in ("constant", "sine") or "until" in term for term in job.scenario.fault
    ):
        return None
    waves: dict[float, NDArray[Any]] = {}
    for term in job.scenario.fault:
        constant = term["kind"] == "constant"
        frequency = 0.0 if constant else float(term["frequency"])
        size = term["size"] if constant else term["amplitude"] * np.exp(1j * term.get("phase", 0.0))
        wave = waves.setdefault(frequency, np.zeros(3, dtype=np.complex128))
        wave[term["axis"] - 1] += size
    omega = np.array(list(waves))
    torque = np.array(list(waves.values()))
    body = known_body(job.plant)
    common = (body.inertia, observer.observer_gain, body.fault_matrix)
    if observer.algorithm == "adaptive":
        transfer = pi_error_transfer(
            omega, *common, observer.integral_gain, observer.proportional_gain
        )
        error = np.einsum("kij,kj->ki", transfer, torque)[:, axis]
        return float(np.sqrt(np.sum(np.abs(error) ** 2 * np.where(omega == 0, 1.0, 0.5))))
    rms = predicted_rms_error(
        np.where(omega[:, None] == 0, torque.real, np.abs(torque)),
        omega,
        LearningLaw(*common, observer.K1, observer.K2, observer.update_interval),
        phases=np.angle(torque),
        variant="sampled" if observer.algorithm == "sampled_ilo" else "continuous",
    )
    return float(rms[axis])
