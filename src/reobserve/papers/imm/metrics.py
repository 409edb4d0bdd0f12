"""Stage metrics: how probable each mode is before and after the fault, and errors of estimates.

Means over the last two seconds before the fault (`_before`) and over the last three of the run
(`_after`), of the probability of a mode; y is the velocity, whose unit the paper does not give. A
number behind `_with_` belongs to a study of changes, named after what is changed and to which
level, and one behind `_at_` to the study of closeness. For the neighbourhood the observer column
holds the tuned number, `search`, or `all` banks. In `theory.metrics.csv` it holds a bank,
`svsf_law` for the SVSF's gain, or a printed equation. `nan` means that it never happens.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from reobserve.ledger.types import Job, Settings, read_job
from reobserve.papers.imm import keys
from reobserve.papers.imm.scoring import check_rules, probabilities, quoted_distance, window
from reobserve.papers.imm.setup import MODES, UNITS
from reobserve.papers.imm.tuning import TUNED
from reobserve.plants.hydraulic_actuator import MOTION
from reobserve.scoring.metrics import Metric
from reobserve.timeseries.series import Series

Rows = Sequence[Mapping[str, Any]]

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
    "<quantity>_with_<change>": "the same as without `_with_`, after one change",
    "nu_gap_at_share_<share>": "between the normal model and its blend with the leakage model",
    "correct_share_at_<noise>_share_<share>": "of runs with a correct diagnosis",
    "mean_probability_at_<noise>_share_<share>": (
        "of the faulty model in the last second, over the runs"
    ),
    "least_gap_at_<noise>": "gap from which on 95 % of the diagnoses are correct",
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


def measure(
    settings: Settings,
    plant: Series,
    estimates: Mapping[str, Series],
    study: Rows | None = None,
) -> list[Metric]:
    """The numbers of a figure; see `MEANINGS`.

    Raises
    ------
    InputError
        If a setting of the metrics cannot be used.
    """
    job = read_job(keys.Ledger, settings)
    check_rules(job.metrics, job.plant.horizon)
    found = []
    for name, estimate in estimates.items():
        found += [Metric(name, *score) for score in _judge(job, plant, name, estimate)]
    if study is not None:
        method = job.study.method
        found += list(_SUMMARIES[method](job, study))
    return found


def _judge(
    job: Job, plant: Series, name: str, estimate: Series
) -> Iterator[tuple[str, float, str]]:
    rules, observer = job.metrics, job.observers[name]
    time, probability = estimate.time, estimate["probability"]
    onset = estimate.events["fault"][0]
    fault = MODES.index(job.scenario.fault)
    yield from probabilities(rules, time, probability, onset, fault)
    high = bool(observer.quoted_high)
    off = quoted_distance(rules, time, probability, observer.quoted, high)
    yield "quoted_distance", off, "1"
    later = window(time, (onset, np.inf))
    for what in ("position", "velocity"):
        if what in estimate.channels:
            error = estimate[what] - plant["motion"][:, MOTION.index(what)]
            yield f"rms_{what}_error", float(np.sqrt(np.mean(error[later] ** 2))), UNITS[what]
    if "outside" in estimate.channels:
        yield "outside_share", float(np.mean(estimate["outside"][later])), "1"


def _neighbourhood(job: Job, study: Rows) -> Iterator[Metric]:
    """What the search says of itself, and how far each number may move."""
    for row in study:
        if row["sweep"] == "kept":
            yield Metric("search", row["quantity"], float(row["value"]), "1")
        elif row["sweep"] == "stated":
            yield Metric(row["observer"], f"{row['quantity']}_stated", float(row["value"]), "1")
    for parameter in TUNED:
        low, high = reach(job, study, parameter)
        yield Metric(parameter, "least_factor", low, "1")
        yield Metric(parameter, "greatest_factor", high, "1")


def reach(job: Job, study: Rows, parameter: str) -> tuple[float, float]:
    """The least and the greatest factor that keep all quoted values within the band.

    Moving outwards from 1, where the largest distance first leaves the band: between two factors
    of the study it is taken as linear over the logarithm.
    """
    worst: dict[float, float] = {}
    for row in study:
        if row["sweep"] in (parameter, "stated"):
            level = float(row["level"])
            worst[level] = max(worst.get(level, 0.0), _off(job, row))
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


def _off(job: Job, row: Mapping[str, Any]) -> float:
    """How far a mean probability is from the paper's; zero where the paper is silent."""
    value, quantity = float(row["value"]), row["quantity"]
    if row["observer"] not in job.observers:
        return 0.0 if np.isfinite(value) else np.inf
    observer = job.observers[row["observer"]]
    if quantity == "normal_before":
        return 1.0 - value if observer.quoted_high else 0.0
    return float(abs(value - observer.quoted[("normal_after", "leakage_after").index(quantity)]))


def _changes(job: Job, study: Rows) -> Iterator[Metric]:
    """Each mean probability, named after the change and its level."""
    for row in study:
        place = f"{row['sweep']}_{float(row['level']):g}"
        yield Metric(row["observer"], f"{row['quantity']}_with_{place}", float(row["value"]), "1")


def _closeness(job: Job, study: Rows) -> Iterator[Metric]:
    """Correct diagnoses and mean probability by bank, noise and share; the gap that is enough."""
    levels = diagnoses(study)
    for (observer, noise), shares in levels.items():
        for share, values in shares.items():
            place = f"{noise}_share_{share:g}"
            if observer == "models":
                if noise == next(iter(levels))[1]:
                    yield Metric("models", f"nu_gap_at_share_{share:g}", values[0], "1")
                continue
            correct = float(np.mean(np.array(values) > 0.5))
            yield Metric(observer, f"correct_share_at_{place}", correct, "1")
            yield Metric(observer, f"mean_probability_at_{place}", float(np.mean(values)), "1")
    wanted = job.study.enough
    for (observer, noise), shares in levels.items():
        if observer != "models":
            gaps = [levels["models", noise][share][0] for share in shares]
            right = [float(np.mean(np.array(values) > 0.5)) for values in shares.values()]
            yield Metric(observer, f"least_gap_at_{noise}", enough_gap(gaps, right, wanted), "1")


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


def diagnoses(study: Rows) -> dict[tuple[str, str], dict[float, list[float]]]:
    """The values of a closeness study by (observer, noise) and share; the gaps as ``models``."""
    found: dict[tuple[str, str], dict[float, list[float]]] = {}
    for row in study:
        shares = found.setdefault((row["observer"], row["sweep"]), {})
        shares.setdefault(float(row["level"]), []).append(float(row["value"]))
    return found


_SUMMARIES = {"neighbourhood": _neighbourhood, "changes": _changes, "closeness": _closeness}
