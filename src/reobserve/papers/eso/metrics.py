"""Stage metrics: errors and lags of the estimated faults, and what the certificates say.

Errors are estimates minus faults, over the windows of the ledger in which a fault varies or is
constant; the observer `plant` has the sizes of what is estimated. A number at coordinates belongs
to a design of the study: at the filter's rate and at what was chosen; there the observer column
holds the kind of design, and errors are without disturbance and noise. In `theory` the observer
column holds an observer or what is judged: the motor (also with the sign of the paper), one or both
outputs, a sensor fault that looks like the actuator's, any observer, and so on.
"""

from __future__ import annotations

from collections.abc import Iterator

from reobserve.papers.eso.scoring import check_rules, corrected_speed, differences, scores, sizes
from reobserve.replication.metrics.metrics import Metric, scores_of
from reobserve.replication.parameters.figure_data import FigureData

_CHOSEN = ("filter_rate", "choice", "level")  # of a design, by its kind

# What each number is, those of the theory included; `<word>` stands for what differs.
MEANINGS = {
    "rms_<fault>_error_<when>": "root mean square error of a fault where it varies or is constant",
    "mean_<fault>_error_<when>": "its mean",
    "rms_<fault>_fault_varying": "root mean square of a fault where it varies",
    "rms_noise_<when>": "root mean square of the noise over the windows of the sensor fault",
    "rms_corrected_speed_error_<when>": (
        "of the measured speed less the estimated sensor fault, over the windows of that fault"
    ),
    "rms_<fault>_difference": (
        "root mean square difference from the estimate of the observer it is compared with"
    ),
    "<fault>_lag": "shift of the estimate that leaves the least error",
    "<quantity> <choice>=<level> rate=<rate>": "the same of a design of the study",
    "<source>_in_<fault>_fault <choice>=<level> rate=<rate>": (
        "standard deviation that disturbances or noise cause"
    ),
    "norm <choice>=<level> rate=<rate>": "proved bound of the H-infinity norm",
    "largest_gain <choice>=<level> rate=<rate>": "largest entry of L",
    "<which>_pole <choice>=<level> rate=<rate>": (
        "distance of the slowest or fastest pole from the axis"
    ),
    "slowest_pole": "distance of the slowest pole from the axis",
    "unobservable_states": "states less the rank of the observability matrix of (A, C)",
    "undetermined_faults": "combinations of constant states and faults that no output shows",
    "overshoot": "of the speed after a step of the reference by one",
    "settling_time": "of the speed, until it stays within two per cent",
    "gamma_floor": "least H-infinity norm that any gains can have",
    "disturbance_floor": "the same from disturbances alone, without noise",
    "actuator_fault_by_constant_current_disturbance": (
        "what a constant disturbance of the current adds to the estimate, over that disturbance"
    ),
    "filter_rate_effect": "largest relative change of `gamma_floor` by the rate of the filter",
    "lemma_difference": "of (19) from (18) for random matrices, relative to the largest entry",
    "gain_difference": "of gains recovered from P and Y, as relative",
    "deviation": "of the noise",
    "norm": "proved bound of the H-infinity norm",
    "gamma": "bound that was asked for; `nan` for designs without one",
    "infinite_poles": "of the error dynamics as a descriptor system",
    "margin_above_norm": (
        "how far below zero (19) can be at a gamma just above the norm; 0 if nowhere"
    ),
    "missed_<fault>_fault": "part of a sine with the fault's frequency that its estimate misses",
    "missed_<fault>_fault_in_the_limit": "the same of ever faster ones",
    "noise_in_<fault>_fault": "standard deviation that noise causes in the estimate",
    "<source>_disturbance_left": (
        "deviation that a random disturbance causes, over the error by a constant one"
    ),
    "bias_of_<fault>_fault_reading_<reading>": (
        "mean error by disturbances in the ranges of one reading"
    ),
    "controller_effect_on_<fault>_fault": "largest change of the estimate by another controller",
}


def measure(data: FigureData) -> Iterator[Metric]:
    """The numbers of a figure; see `MEANINGS`.

    Raises
    ------
    InputError
        If a setting of the metrics cannot be used.
    """
    job = data.job
    check_rules(job.metrics, job.plant)
    yield from scores_of("plant", sizes(job.metrics, data.plant))
    for name, estimate in data.estimates.items():
        yield from scores_of(name, scores(job.metrics, data.plant, estimate))
        yield from scores_of(name, corrected_speed(job.metrics, data.plant, estimate))
        other = data.estimates.get(job.observers[name].compared_with)
        if other is not None:
            yield from scores_of(name, differences(job.metrics, estimate, other))
    if data.study:
        for design, numbers in data.study.groups("kind", *_CHOSEN, "quantity", "unit"):
            kind, rate, choice, level, quantity, unit = design
            at = {"rate": rate, choice: level}
            yield Metric.at(kind, (quantity, numbers.value(), unit), **at)
