"""Stage metrics: probabilities of the modes before and after the fault, and errors of estimates.

Means over the last two seconds before the fault (`_before`) and over the last three of the run
(`_after`), of the probability of a mode; y is the velocity, whose unit the paper does not give.
Metrics with coordinates belong to a study. Those of the changes have the change and its level.
For the neighbourhood the observer column holds the tuned number, `search`, or `all` banks. In
`theory.metrics.csv` it holds a bank, or `model` for the normal one. Baselines
are `guess`, a bank that always gives all modes the same probability; `random_gain`, a filter that
corrects a random share of each innovation, or such a bank with the layers of the SVSF named after
it; and `measurement`, the measured velocity. Checks of main claims must reject them. `nan` means
that it never happens.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import takewhile

import numpy as np
from numpy.typing import NDArray

from reobserve.core.arguments import as_kind
from reobserve_papers.metrics.metrics import Metric, Score, name_at, scores_of
from reobserve_papers.metrics.responses import root_mean_square, scored
from reobserve_papers.metrics.study_table import StudyTable
from reobserve_papers.papers.imm import keys
from reobserve_papers.papers.imm.keys import MODES
from reobserve_papers.papers.imm.scoring import GUESS, check_rules, off_quoted, probabilities
from reobserve_papers.papers.imm.study_rows import STATED, TUNED
from reobserve_papers.papers.imm.units import UNITS
from reobserve_papers.parameters.figure_data import FigureData

Array = NDArray[np.float64]

# By layout of a figure: what its numbers are of, beside observers.
SUBJECTS = {
    "normal": "guess",
    "leakage": "guess",
    "switching": "random_gain_<bank>",
    "neighbourhood": "leave process_noise_<number> measurement_noise_<number> search",
    "changes": "all",
    "theory": "measurement model random_gain",
}

# What each number is, those of the theory included; `<word>` stands for what differs.
MEANINGS = {
    "normal_before": "mean probability of the normal mode before the fault",
    "<mode>_after": "mean probability of a mode after it",
    "<mode>_spread": "its standard deviation over time, after the fault",
    "overshoot": "maximum deviation of the normal mode from its later mean, in the window of "
    "the overshoot",
    "alarm_samples": (
        "samples from the fault until the normal mode falls below the level of an alarm; nan if "
        "it was there in the seconds before"
    ),
    "diagnosed_share": "share of the last three seconds in which the true mode is the most "
    "probable",
    "rms_velocity_error": "root mean square error of the combined estimate after the fault",
    "rms_velocity_error window=after": "the same in the window of the probabilities",
    "velocity_error_share": "the first of these as a share of the velocity's own root mean square",
    "saturation_fraction": "share of the innovations after the fault that are outside the "
    "boundary layer",
    "chattering_fraction": "share of the innovations after the fault that are outside and "
    "have changed their sign",
    "chattering_size": "RMS of the velocity's corrections by these, as a share of its own",
    "chattering_size window=after": "the same in the window of the probabilities",
    "trials": "number of trials of the search, each with three banks",
    "earlier_trials": "number of trials of earlier searches, whose results are not used",
    "tuned": "number of tuned parameters",
    "targets": "number of quoted values that are targets",
    "distance": "remaining root mean square deviation over time and targets",
    "minimum_factor": "minimum factor to a tuned parameter with which all quoted values are "
    "within the band",
    "maximum_factor": "the maximum such factor",
    "<quantity> <change>=<level>": "the same as without it, after one change, to which level",
    "normal_after variant=<frozen,kalman,weighted,whole,zero_rate>": (
        "of an SVSF-IMM with one cause changed, or none: `whole`; gains are `frozen` at their means"
        " or, `weighted`, at their effective values"
    ),
    "fault_after variant=<frozen,kalman,weighted,whole,zero_rate>": "the same of the faulty mode",
    "saturation_fraction variant=whole": "of the innovations after the fault, outside the layers",
    "chattering_fraction variant=whole": "of those that lie there and have changed their sign",
    "chattering_after variant=whole": "the same in the window of the probabilities",
    "corrected_radius": (
        "largest radius of (I - W C) A: what full correction of all outputs leaves"
    ),
    "single_prediction_error": (
        "RMS a priori error of the velocity after a leak, of the normal model's filter alone"
    ),
    "bank_prediction_error": "the same of the bank",
    "layer_ratio": "largest a priori output error over a layer that the model alone leaves",
    "open_<state>_error": "RMS error of a state of the normal model without correction, after a "
    "leak; nan if it is rounding",
    "informed_<state>_error": "the same with a filter whose layers are as wide as the error "
    "of the model",
    "informed_<state>_error layers=step": "the same, as wide as its error over one step",
    "informed_<state>_error record=noisy": "the same, layers of the first width, from a record "
    "with noise of covariance R",
}


def measure(data: FigureData[keys.Job]) -> Iterator[Metric]:
    """The numbers of a figure (see `MEANINGS`)."""
    job = data.job
    check_rules(job.metrics, job.plant.horizon, job.scenario.period)
    for name in data.estimates:
        yield from scores_of(name, _scores(data, name))
    if isinstance(job.figure, keys.Probabilities):
        for quantity in ("normal_before", *(f"{mode}_after" for mode in MODES)):
            yield Metric(GUESS, quantity, 1.0 / len(MODES), "1")
        yield Metric(GUESS, "diagnosed_share", 0.0, "1")  # no mode is the most probable
    if job.study is not None:
        yield from _SUMMARIES[job.study.method](data)


def _scores(data: FigureData[keys.Job], name: str) -> Iterator[Score]:
    job, estimate = data.job, data.estimates[name]
    rules = job.metrics
    time, probability = estimate.time, estimate["probability"]
    onset = estimate.events["fault"][0]
    fault = MODES.index(job.scenario.fault)
    yield from probabilities(rules, time, probability, onset, fault)
    later = scored("scenario.onset", time, onset, np.inf, closed="right")
    late = scored("metrics.after", time, *rules.after, closed="right")
    moved = data.plant["motion"][:, list(UNITS).index("velocity")]
    error = estimate["velocity"] - moved
    size, compared = float(root_mean_square(error[later])), float(root_mean_square(error[late]))
    yield "rms_velocity_error", size, UNITS["velocity"]
    yield name_at("rms_velocity_error", window="after"), compared, UNITS["velocity"]
    yield "velocity_error_share", size / float(root_mean_square(moved[later])), "1"
    if "saturated" in estimate.channels:
        yield "saturation_fraction", float(np.mean(estimate["saturated"][later])), "1"
        yield "chattering_fraction", float(np.mean(estimate["chattering"][later])), "1"
        jumps = estimate["chattering_correction"]
        for which, at in ((later, {}), (late, {"window": "after"})):
            share = float(root_mean_square(jumps[which]) / root_mean_square(moved[which]))
            yield name_at("chattering_size", **at), share, "1"


def _neighbourhood(data: FigureData[keys.Job]) -> Iterator[Metric]:
    """Numbers of the search, and how far each tuned number may move."""
    study, settings = data.study, as_kind("study", data.job.study, keys.Neighbourhood)
    yield Metric("search", "earlier_trials", float(sum(settings.earlier_trials)), "1")
    for (name, quantity), rows in study.where(sweep="kept").groups("observer", "quantity"):
        yield Metric(name, quantity, rows.value(), "1")
    for parameter in TUNED:
        low, high = reach(data.job, settings.band, study, parameter)
        yield Metric(parameter, "minimum_factor", low, "1")
        yield Metric(parameter, "maximum_factor", high, "1")


def reach(job: keys.Job, band: float, study: StudyTable, parameter: str) -> tuple[float, float]:
    """Minimum and maximum factor that keep all quoted values within a band.

    Outwards from 1, it is the last one of the study before the largest distance leaves the band.
    """
    worst: dict[float, float] = {}
    for sweep in (parameter, "stated"):
        coordinates = "observer", "quantity", "level", "value"
        for (name, quantity, level, value), _ in study.where(sweep=sweep).groups(*coordinates):
            distance = off_quoted(job.observers, name, quantity, value)
            worst[level] = max(worst.get(level, 0.0), distance)
    below = sorted((level for level in worst if level <= 1.0), reverse=True)
    above = sorted(level for level in worst if level >= 1.0)
    return _leaves(worst, below, band), _leaves(worst, above, band)


def _leaves(worst: dict[float, float], levels: list[float], band: float) -> float:
    """The last level before the distance exceeds the band, or the first one if that does."""
    inside = list(takewhile(lambda level: worst[level] <= band, levels))
    return inside[-1] if inside else levels[0]


def _changes(data: FigureData[keys.Job]) -> Iterator[Metric]:
    """Each mean probability with one setting changed, at its level."""
    coordinates = "observer", "quantity", "sweep", "level"
    for (name, quantity, sweep, level), rows in data.study.groups(*coordinates):
        yield Metric.at(name, (quantity, rows.value(), "1"), **{sweep: level})


def _causes(data: FigureData[keys.Job]) -> Iterator[Metric]:
    """Metrics of an SVSF-IMM as stated with one cause changed."""
    for (name, variant, quantity), row in data.study.where(run=STATED).groups(
        "observer", "sweep", "quantity"
    ):
        yield Metric.at(name, (quantity, row.value(), "1"), variant=variant)


_SUMMARIES = {
    "neighbourhood": _neighbourhood,
    "changes": _changes,
    "causes": _causes,
    "frozen": _causes,
}
