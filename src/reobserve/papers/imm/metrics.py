"""Stage metrics: how probable each mode is before and after the fault, and errors of estimates."""

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


def measure(
    settings: Settings,
    plant: Series,
    estimates: Mapping[str, Series],
    study: Rows | None = None,
) -> list[Metric]:
    """The numbers of a figure; see ``results/README.md`` for their names.

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
