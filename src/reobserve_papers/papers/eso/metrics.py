"""Stage metrics: errors and lags of the estimated faults, and numbers of the certificates.

Errors are estimates minus faults, over the windows in which a fault varies or is constant. The rows
of the observer `plant` are the sizes of faults and noise. A number with coordinates belongs to a
design of the study; the coordinates are the filter rate and the varied setting. There the observer
column holds the kind of design, and errors are without disturbance and noise. In `theory` the
observer column holds an observer or another subject: the motor (also with the printed sign), one or
both outputs, and so on.

`random` is the median over five observers whose gains are random but stable. A check of estimates
that they pass tests nothing. `lag=counted` is the whole error, `lag=removed`
what is left of it after the estimate is shifted in time. `at=ends` is taken at the ends of the
times for which noise and disturbances are held, `at=time` over all time.
"""

from __future__ import annotations

from collections.abc import Iterator

from reobserve_papers.metrics.metrics import Metric, scores_of
from reobserve_papers.papers.eso import keys
from reobserve_papers.papers.eso.scoring import (
    check_rules,
    corrected_speed,
    differences,
    scores,
    sizes,
)
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.signals.series import Series

_CHOSEN = ("filter_rate", "choice", "level")  # columns that identify a design of a kind

# By layout of a figure: what its numbers are of, beside observers.
SUBJECTS = {
    "actuator": "plant random",
    "sensor": "plant random",
    "designs": "plant pi_<solution> pd_pi_<solution>",
    "theory": "controller motor motor_as_printed noise one_output random two_outputs",
}

# The meaning of each number, including those of the theory; `<word>` is a placeholder.
MEANINGS = {
    "rms_<fault>_error_constant": "root mean square error of a fault where it is constant",
    "rms_<fault>_error_varying lag=<counted,removed>": (
        "root mean square error of a fault where it varies, with the lag counted or removed"
    ),
    "rms_<fault>_fault_varying": "root mean square of a fault where it varies",
    "rms_noise_constant": "root mean square of the noise where the sensor fault is constant",
    "rms_corrected_speed_error_constant": (
        "root mean square error of the measured speed minus the estimated sensor fault, where the "
        "sensor fault is constant"
    ),
    "rms_<fault>_difference": (
        "root mean square difference between the estimates of two observers that are compared"
    ),
    "largest_gain <choice>=<level> rate=<rate>": "largest entry of L (14) of a design",
    "<fault>_lag": "shift of the estimate that minimises the error",
    "<quantity> <choice>=<level> rate=<rate>": "the same for a design of the study",
    "<source>_in_<fault>_fault <choice>=<level> rate=<rate>": (
        "standard deviation of the estimate due to disturbances or noise"
    ),
    "impulsive_modes": "modes of the error that have no finite pole",
    "slowest_pole": "distance of the slowest pole from the imaginary axis",
    "unobservable_states": "number of states minus the rank of the observability matrix of (A, C)",
    "rosenbrock_rank_deficiency": (
        "number of combinations of constant states and faults that are unobservable"
    ),
    "overshoot": "overshoot of the speed after a unit step of the reference",
    "settling_time": "time from which the speed stays within two per cent",
    "deviation": "standard deviation of the noise",
    "norm": "proved upper bound of the H-infinity norm",
    "norm from=<disturbances,noise_too,all> to=<errors,faults>": (
        "the same from the disturbances alone, from these and the noise, or with the rates of the "
        "faults, to the errors of states and faults or of the estimated faults alone"
    ),
    "gamma": "specified bound; `nan` for designs without one",
    "missed_fast_<fault>_fault lag=<counted,removed>": (
        "share of a fast sinusoidal fault that its estimate misses, with the lag counted or removed"
    ),
    "left_of_<fault>_jump": "largest error from a given time after a unit jump on",
    "<source>_in_<fault>_fault at=<ends,time>": (
        "standard deviation of the estimate due to noise or disturbances"
    ),
    "<source>_disturbance_left at=<ends,time>": (
        "standard deviation due to a random disturbance, over the error due to a constant one"
    ),
}


def measure(data: FigureData[keys.Job]) -> Iterator[Metric]:
    """The numbers of a figure (see `MEANINGS`)."""
    job = data.job
    check_rules(job.metrics, job.plant)
    yield from scores_of("plant", sizes(job.metrics, data.plant))
    for name, estimate in data.estimates.items():
        yield from scores_of(name, scores(job.metrics, data.plant, estimate))
        yield from scores_of(name, corrected_speed(job.metrics, data.plant, estimate))
        other = data.estimates.get(job.observers[name].compared_with)
        if other is not None:
            yield from scores_of(name, differences(job.metrics, estimate, other))
    if isinstance(job.figure, keys.Faults):
        yield from _by_chance(job, data.plant)
    if data.study:
        for design, numbers in data.study.groups("kind", *_CHOSEN, "quantity", "unit"):
            kind, rate, choice, level, quantity, unit = design
            at = {"rate": rate, choice: level}
            yield Metric.at(kind, (quantity, numbers.value(), unit), **at)


def _by_chance(job: keys.Job, plant: Series) -> Iterator[Metric]:
    """The median scores of observers with random gains, started from zero."""
    # Late, since observers load numba.
    from reobserve.observers.extended_state import ExtendedStateObserver
    from reobserve_papers.papers.eso.observe import estimates_on
    from reobserve_papers.papers.eso.random_gains import RANDOM, medians, random_gains
    from reobserve_papers.papers.eso.setup import augmented

    system, metrics = augmented(job.plant, 1.0), list[Metric]()
    for gains in random_gains(system):
        observer = ExtendedStateObserver(system, gains=gains, sampling_period=2.0 * plant.step)
        estimate = estimates_on(observer, plant)
        metrics += scores_of(RANDOM, scores(job.metrics, plant, estimate))
        metrics += scores_of(RANDOM, corrected_speed(job.metrics, plant, estimate))
    yield from medians(metrics)
