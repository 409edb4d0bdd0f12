"""Stage metrics: how well the fault is estimated, how fast it is seen, and what theory predicts.

e is the fault torque minus its estimate on the faulty axis. Scores start one second (the ledger's
`metrics.settling_skip`) after every onset; `nan` means that it never happens, or that there is
none. The observer `learning` is the reading of (3) that the ledger names. The lower part is the
theory's, in `theory.metrics.csv`: there the observer column may hold what is judged (`identity` is
the reading with K1 = I that the ledger names, `integral` an integral law), the stuck fault is that
of Fig. 1, and an interval is tau.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reobserve.papers.ilo.prediction import predicted_error
from reobserve.papers.ilo.reading import READINGS, of_reading
from reobserve.papers.ilo.scoring import Errors, scored
from reobserve.replication.metrics.metrics import Metric, Score, scores_of
from reobserve.replication.metrics.responses import first_crossing, peak, settling_time
from reobserve.replication.parameters.figure_data import FigureData

# What each number is, those of the theory included; `<word>` stands for what differs.
MEANINGS = {
    "rms_error": "root mean square of e over time",
    "relative_rms_error": "the same over that of the fault",
    "peak_error": "largest |e|, both limits counted where the estimate jumps",
    "late_rms_error": "root mean square of e in the last second",
    "final_error": "|e| at the end",
    "residual_before_fault": "largest estimate on any axis before the first onset",
    "detection_delay": "from the first onset until the estimate exceeds the threshold",
    "settling_time": "from the last onset until |e| stays below the threshold",
    "leakage": "largest estimate on the other two axes after the first onset",
    "predicted_rms_error": "what linear theory says of `rms_error` in steady state",
    "relative_rms_error <sweep>=<level>": "mean over the runs of a study at one level",
    "violations": "random cases in which (5) of Lemma 1 fails",
    "violations_without_mismatch": "the same of (12)",
    "closest_ratio": "least right side of (5) over the left in these cases",
    "torque_ratio size=<size>": (
        "largest difference of gyroscopic torques per rate error of this size [rad/s]"
    ),
    "one_sided_constant": "eta that the proof needs at the initial rate",
    "required_damping_at_identity": "least Lambda with which Theorem 1 certifies K1 = I",
    "least_constant_error": (
        "least share of a constant fault that certified designs leave unestimated"
    ),
    "least_promised_error": "least error that (18) promises, over the largest fault with that k_d",
    "unstable_share": "of random certified designs",
    "bound_18_ratio": (
        "right side of (18) over the left, of a certified design under the stuck fault"
    ),
    "certified": "one if the conditions of Theorem 1 have a solution for an observer",
    "required_damping": "least Lambda with which they have one",
    "gain_margin multiple=<multiple>": (
        "factor to the largest stable K2, v updated at a multiple of the interval"
    ),
    "noise_gain multiple=<multiple>": (
        "standard deviation of v over that of a noise drawn at each update and held"
    ),
    "unstable_roots": "characteristic roots in the right half-plane",
    "worst_round_gain": "largest factor on an error from one interval to the next",
    "growth_rate K1=<gain>": "of errors with this K1",
    "sine_error interval=<interval>": "amplitude of e over that of sin 10 t, linear theory",
    "sine_error_slope": "of its logarithm over that of the interval",
    "largest_interval frequency=<frequency>": (
        "longest interval that keeps it below 5 %, half a period at most"
    ),
    "slowest_decay": "of the slowest pole of the errors, v held",
    "damping_ratio": "the least of these poles",
    "distance_from_integrator": (
        "of the transfer to e under sin 10 t from that with the integrator K2 / tau, over its size"
    ),
    "distance_from_matched": "the same with the proportional part K2 / 2",
    "disturbance_gain": "largest part of a high-frequency torque that shows in the estimate",
    "operations": "multiplications and additions of the estimation law a sampling period",
    "decay_rate_at_rest": "slowest of the adaptive observer's errors, without torques",
    "residual_after_other_start": (
        "largest estimate in the second before the fault, if the observer starts from zero rate"
    ),
    "late_relative_error_after_other_start": (
        "root mean square of e over the fault in the last second of that run"
    ),
    "late_relative_error_under_a_constant": (
        "the same of the adaptive observer under the stuck fault"
    ),
    "relative_error slowdown=<factor>": "the same from when updates become rarer by a factor",
    "rising_share": "of the times at which V exceeds what it was an interval before, once d = 0",
    "largest_rise": "largest relative change of V over an interval",
    "relative_error": "root mean square of e over the aperiodic fault; integral law of one gain",
    "relative_error_between_jumps": "the same for a fault that holds random values, jumps left out",
    "relative_error_under_random_fault": "the same for a fault that joins these values by lines",
    "relative_error_under_noise": "the same for the aperiodic fault, measured with noise",
    "relative_error_with_wrong_inertia": "the same without noise, the observer's inertia off",
    "relative_rate_error_under_jumps": "root mean square of the error of the rate, over the rate",
}


def measure(data: FigureData) -> Iterator[Metric]:
    """The numbers of a figure, observer by observer; see `MEANINGS`."""
    scores = [one for name in data.estimates for one in scores_of(name, _scores(data, name))]
    yield from scores
    if READINGS.keys() <= data.estimates.keys():
        yield from of_reading(scores, data.job.metrics.reading)
    score = "relative_rms_error"
    if data.study:  # the mean over the runs at each level
        for (observer, sweep, level), runs in data.study.groups("observer", "sweep", "level"):
            yield Metric.at(observer, (score, float(np.mean(runs[score])), "1"), **{sweep: level})


def _scores(data: FigureData, name: str) -> Iterator[Score]:
    job, plant, estimate = data.job, data.plant, data.estimates[name]
    rules = job.metrics
    axis = rules.axis - 1
    onsets = plant.events["onsets"]
    errors = Errors.of(plant, estimate, axis)
    score = scored(errors, onsets, rules.settling_skip)
    end = float(estimate.time[-1])
    late = errors.window(end - rules.late_window)
    first = onsets[0] if onsets else end
    last = onsets[-1] if onsets else 0.0
    before = estimate.time < first - 1e-9
    time, v = estimate.time[~before], estimate["fault"][~before]
    v_before = estimate["fault_before"][~before]
    threshold = rules.residual_threshold

    yield "rms_error", score.root_mean_square, "N m"
    yield "relative_rms_error", score.relative_root_mean_square, "1"
    yield "peak_error", peak(score.start, score.end), "N m"
    yield "late_rms_error", late.root_mean_square, "N m"
    yield "final_error", abs(float(errors.end[-1])), "N m"
    yield "residual_before_fault", peak(estimate["fault"][before]), "N m"
    seen = first_crossing(time, v[:-1, axis], v_before[1:, axis], threshold)
    yield "detection_delay", seen - first, "s"
    after = errors.window(last)
    settled = settling_time(np.append(after.time, end), after.start, after.end, threshold)
    yield "settling_time", settled - last, "s"
    yield "leakage", peak(np.delete(v, axis, axis=1)), "N m"
    predicted = predicted_error(job, job.observers[name], axis)
    if predicted is not None:
        yield "predicted_rms_error", predicted, "N m"
