"""Stage metrics: how probable each mode is before and after the fault, and errors of estimates.

Means over the last two seconds before the fault (`_before`) and over the last three of the run
(`_after`), of the probability of a mode; y is the velocity, whose unit the paper does not give.
What stands at a coordinate belongs to a study: of changes, at what is changed and its level, or of
closeness, at the noise and the share of the leak. For the neighbourhood the observer column holds
the tuned number, `search`, or `all` banks. In `theory.metrics.csv` it holds a bank,
`svsf_law` for the SVSF's gain, or a printed equation. `nan` means that it never happens.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from reobserve.ledger.figure_data import FigureData
from reobserve.ledger.types import Job
from reobserve.papers.imm.scoring import check_rules, probabilities, quoted_distance
from reobserve.papers.imm.setup import MODES, UNITS
from reobserve.papers.imm.tuning import TUNED
from reobserve.plants.hydraulic_actuator import MOTION
from reobserve.scoring.metrics import Metric, Score, scores_of
from reobserve.scoring.responses import root_mean_square, window
from reobserve.scoring.study_table import StudyTable

Array = NDArray[np.float64]

# What each number is, those of the theory included; `<word>` stands for what differs.
MEANINGS = {
    "<mode>_before": "mean probability of a mode before the fault",
    "<mode>_after": "mean probability of a mode after it",
    "<mode>_spread": "its standard deviation over time, after the fault",
    "overshoot": "how far the normal mode exceeds its mean from 5.5 to 6.5 s",
    "alarm_delay": "from the fault until the normal mode falls below 0.9",
    "alarm_samples": "the same in samples",
    "diagnosis_delay": "from the fault until the right mode is the most probable",
    "diagnosed_share": "share of the last three seconds in which it is",
    "false_alarm_share": "share of the time before the fault with the normal mode below 0.9",
    "quoted_distance": "root mean square over time from the values that the paper quotes",
    "rms_position_error": "of the combined estimate after the fault",
    "rms_velocity_error": "of the combined estimate after the fault",
    "outside_share": "of the innovations after the fault that lie outside the boundary layer",
    "trials": "of the search, each of three banks",
    "tuned": "how many numbers the search moved",
    "targets": "how many quoted values it sought",
    "distance": "root mean square over time and values that it left",
    "as_found": "one if the ledger still has the numbers that the search found",
    "<quantity>_stated": "with the numbers of the ledger",
    "least_factor": "to a tuned number that keeps all quoted values within the band",
    "greatest_factor": "the greatest such factor",
    "<quantity> <change>=<level>": "the same as without it, after one change, to which level",
    "nu_gap share=<share>": "between the normal model and its blend with the leakage model",
    "correct_share noise=<noise> share=<share>": "of runs with a correct diagnosis",
    "mean_probability noise=<noise> share=<share>": (
        "of the faulty model in the last second, over the runs"
    ),
    "least_gap noise=<noise>": "gap from which on 95 % of the diagnoses are correct",
    "corrected_radius_<outputs>": (
        "largest radius of (I - H^+ H) A: what full correction of all outputs leaves"
    ),
    "single_velocity_error": "RMS after a leak, of the normal model's filter alone",
    "bank_velocity_error": "the same of the bank",
    "least_variance_rise": (
        "by which the variance is larger at least with gains near Kalman's, as a part of it"
    ),
    "largest_weight_excess": "by which mixing weights do not sum to one, by (8) as it is printed",
    "states_without_gain": "of the four, by (15) as it is printed",
}


def measure(data: FigureData) -> Iterator[Metric]:
    """The numbers of a figure; see `MEANINGS`.

    Raises
    ------
    InputError
        If a setting of the metrics cannot be used.
    """
    job = data.job
    check_rules(job.metrics, job.plant.horizon)
    for name in data.estimates:
        yield from scores_of(name, _scores(data, name))
    if job.study is not None:
        yield from _SUMMARIES[job.study.method](data)


def _scores(data: FigureData, name: str) -> Iterator[Score]:
    job, estimate = data.job, data.estimates[name]
    rules, observer = job.metrics, job.observers[name]
    time, probability = estimate.time, estimate["probability"]
    onset = estimate.events["fault"][0]
    fault = MODES.index(job.scenario.fault)
    yield from probabilities(rules, time, probability, onset, fault)
    high = bool(observer.quoted_high)
    off = quoted_distance(rules, time, probability, observer.quoted, high)
    yield "quoted_distance", off, "1"
    later = window(time, onset, np.inf, closed="right")
    for what in ("position", "velocity"):
        if what in estimate.channels:
            error = estimate[what] - data.plant["motion"][:, MOTION.index(what)]
            yield f"rms_{what}_error", float(root_mean_square(error[later])), UNITS[what]
    if "outside" in estimate.channels:
        yield "outside_share", float(np.mean(estimate["outside"][later])), "1"


def _neighbourhood(data: FigureData) -> Iterator[Metric]:
    """What the search says of itself, and how far each number may move."""
    study = data.study
    for sweep, ending in (("kept", ""), ("stated", "_stated")):
        for (name, quantity), rows in study.where(sweep=sweep).groups("observer", "quantity"):
            yield Metric(name, f"{quantity}{ending}", rows.value(), "1")
    for parameter in TUNED:
        low, high = reach(data.job, study, parameter)
        yield Metric(parameter, "least_factor", low, "1")
        yield Metric(parameter, "greatest_factor", high, "1")


def reach(job: Job, study: StudyTable, parameter: str) -> tuple[float, float]:
    """The least and the greatest factor that keep all quoted values within the band.

    Moving outwards from 1, where the largest distance first leaves the band: between two factors
    of the study it is taken as linear over the logarithm.
    """
    worst: dict[float, float] = {}
    for sweep in (parameter, "stated"):
        coordinates = "observer", "quantity", "level", "value"
        for (name, quantity, level, value), _ in study.where(sweep=sweep).groups(*coordinates):
            worst[level] = max(worst.get(level, 0.0), _off(job, name, quantity, value))
    band = job.metrics.band
    below = sorted((level for level in worst if level <= 1.0), reverse=True)
    above = sorted(level for level in worst if level >= 1.0)
    return _leaves(worst, below, band), _leaves(worst, above, band)


def _leaves(worst: dict[float, float], levels: list[float], band: float) -> float:
    """Where the distance, at levels in their order, first exceeds the band; the last if nowhere."""
    if not worst[levels[0]] <= band:
        return levels[0]
    for level, further in pairwise(levels):
        if not worst[further] <= band:
            near, far = worst[level], worst[further]
            share = (band - near) / (far - near) if np.isfinite(far) else 0.0
            return float(level * (further / level) ** share)
    return levels[-1]


def _off(job: Job, name: str, quantity: str, value: float) -> float:
    """How far a mean probability is from the paper's; zero where the paper is silent."""
    if name not in job.observers:
        return 0.0 if np.isfinite(value) else np.inf
    observer = job.observers[name]
    if quantity == "normal_before":
        return 1.0 - value if observer.quoted_high else 0.0
    return float(abs(value - observer.quoted[("normal_after", "leakage_after").index(quantity)]))


def _changes(data: FigureData) -> Iterator[Metric]:
    """Each mean probability with one thing changed, at the level to which."""
    coordinates = "observer", "quantity", "sweep", "level"
    for (name, quantity, sweep, level), rows in data.study.groups(*coordinates):
        yield Metric.at(name, (quantity, rows.value(), "1"), **{sweep: level})


def _closeness(data: FigureData) -> Iterator[Metric]:
    """Correct diagnoses and mean probability by bank, noise and share; the gap that is enough."""
    study, enough = data.study, data.job.study.enough
    gaps = study.where(observer="models")
    for (share,), rows in gaps.groups("level"):
        yield Metric.at("models", ("nu_gap", float(rows["value"][0]), "1"), share=share)
    banks = study.where(quantity="probability")
    for (name, sweep, share), runs in banks.groups("observer", "sweep", "level"):
        at = {"noise": noise_of(sweep), "share": share}
        right, mean = float(np.mean(runs["value"] > 0.5)), float(np.mean(runs["value"]))
        yield Metric.at(name, ("correct_share", right, "1"), **at)
        yield Metric.at(name, ("mean_probability", mean, "1"), **at)
    for (name, sweep), _ in banks.groups("observer", "sweep"):
        gap, diagnosed, drawn = diagnoses(study, name, sweep)
        least = enough_gap(gap.tolist(), (diagnosed / drawn).tolist(), enough)
        yield Metric.at(name, ("least_gap", least, "1"), noise=noise_of(sweep))


def noise_of(sweep: str) -> float:
    """The noise of a sweep of the study of closeness."""
    return float(sweep.removeprefix("noise_"))


def diagnoses(study: StudyTable, name: str, sweep: str) -> tuple[Array, Array, Array]:
    """By pair of models: their gap, how many runs a bank diagnosed, and how many there are."""
    same_noise = study.where(sweep=sweep)
    gaps = same_noise.where(observer="models")
    found = [
        (gaps.value(level=share), np.count_nonzero(runs["value"] > 0.5), len(runs))
        for (share,), runs in same_noise.where(observer=name).groups("level")
    ]
    gap, right, drawn = np.array(found, dtype=np.float64).T
    return gap, right, drawn


def enough_gap(gaps: list[float], right: list[float], wanted: float) -> float:
    """The gap from which on the share of correct diagnoses is ``wanted`` or more.

    Between the last gap of the study with a smaller share and the next it is taken as linear over
    the logarithm; nan if the widest gap is not enough, and the least one if all are.
    """
    good = len(gaps)
    while good and right[good - 1] >= wanted:
        good -= 1
    if good == len(gaps):
        return float("nan")
    if good == 0:
        return gaps[0]
    share = (wanted - right[good - 1]) / (right[good] - right[good - 1])
    return float(gaps[good - 1] * (gaps[good] / gaps[good - 1]) ** share)


_SUMMARIES = {"neighbourhood": _neighbourhood, "changes": _changes, "closeness": _closeness}
