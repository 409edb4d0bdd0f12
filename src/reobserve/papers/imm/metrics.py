"""Stage metrics: how probable each mode is before and after the fault, and errors of estimates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from reobserve.matrices import as_scalar
from reobserve.metrics import Metric
from reobserve.papers.imm.scoring import check_rules, probabilities, quoted_distance, window
from reobserve.papers.imm.setup import MODES, UNITS
from reobserve.papers.imm.tuning import TUNED
from reobserve.plants.hydraulic_actuator import MOTION
from reobserve.series import Series

Rows = Sequence[Mapping[str, Any]]


def measure(
    settings: dict[str, Any],
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
    check_rules(settings["metrics"])
    found = []
    for name, estimate in estimates.items():
        found += [Metric(name, *score) for score in _judge(settings, plant, name, estimate)]
    if study is not None:
        method = settings["study"]["method"]
        found += list(_SUMMARIES[method](settings, study))
    return found


def _judge(
    settings: dict[str, Any], plant: Series, name: str, estimate: Series
) -> Iterator[tuple[str, float, str]]:
    rules, observer = settings["metrics"], settings["observers"][name]
    time, probability = estimate.time, estimate["probability"]
    onset = estimate.events["fault"][0]
    fault = MODES.index(settings["scenario"]["fault"])
    yield from probabilities(rules, time, probability, onset, fault)
    high = bool(observer["quoted_high"])
    off = quoted_distance(rules, time, probability, observer["quoted"], high)
    yield "quoted_distance", off, "1"
    later = window(time, (onset, np.inf))
    for what in ("position", "velocity"):
        if what in estimate.channels:
            error = estimate[what] - plant["motion"][:, MOTION.index(what)]
            yield f"rms_{what}_error", float(np.sqrt(np.mean(error[later] ** 2))), UNITS[what]
    if "outside" in estimate.channels:
        yield "outside_share", float(np.mean(estimate["outside"][later])), "1"


def _neighbourhood(settings: dict[str, Any], study: Rows) -> Iterator[Metric]:
    """What the search says of itself, and how far each number may move."""
    for row in study:
        if row["sweep"] == "kept":
            yield Metric("search", row["quantity"], float(row["value"]), "1")
        elif row["sweep"] == "stated":
            yield Metric(row["observer"], f"{row['quantity']}_stated", float(row["value"]), "1")
    for parameter in TUNED:
        low, high = reach(settings, study, parameter)
        yield Metric(parameter, "least_factor", low, "1")
        yield Metric(parameter, "greatest_factor", high, "1")


def reach(settings: dict[str, Any], study: Rows, parameter: str) -> tuple[float, float]:
    """The least and the greatest factor that keep all quoted values within the band.

    Factors are those of the study; moving outwards from 1, the last before one that does not.
    """
    ends = []
    outside: dict[float, bool] = {}
    band = as_scalar("metrics.band", settings["metrics"]["band"])
    for row in study:
        if row["sweep"] == parameter:
            off = _off(settings, row)
            level = float(row["level"])
            outside[level] = outside.get(level, False) or not off <= band
    for side in (-1.0, 1.0):
        end = 1.0
        for level in sorted((x for x in outside if side * np.log(x) > 0), key=lambda x: side * x):
            if outside[level]:
                break
            end = level
        ends.append(end)
    return ends[0], ends[1]


def _off(settings: dict[str, Any], row: Mapping[str, Any]) -> float:
    """How far a mean probability is from the paper's; zero where the paper is silent."""
    value, quantity = float(row["value"]), row["quantity"]
    if row["observer"] not in settings["observers"]:
        return 0.0 if np.isfinite(value) else np.inf
    observer = settings["observers"][row["observer"]]
    if quantity == "normal_before":
        return 1.0 - value if observer["quoted_high"] else 0.0
    return float(abs(value - observer["quoted"][("normal_after", "leakage_after").index(quantity)]))


def _changes(settings: dict[str, Any], study: Rows) -> Iterator[Metric]:
    """Each mean probability, named after the change and its level."""
    for row in study:
        place = f"{row['sweep']}_{float(row['level']):g}"
        yield Metric(row["observer"], f"{row['quantity']}_with_{place}", float(row["value"]), "1")


def _closeness(settings: dict[str, Any], study: Rows) -> Iterator[Metric]:
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
    wanted = as_scalar("metrics.enough", settings["metrics"]["enough"])
    for (observer, noise), shares in levels.items():
        if observer != "models":
            gaps = levels["models", noise]
            good = [gaps[share][0] for share, values in shares.items()
                    if np.mean(np.array(values) > 0.5) >= wanted]  # fmt: skip
            yield Metric(observer, f"least_gap_at_{noise}", min(good, default=np.nan), "1")


def diagnoses(study: Rows) -> dict[tuple[str, str], dict[float, list[float]]]:
    """The values of a closeness study by (observer, noise) and share; the gaps as ``models``."""
    found: dict[tuple[str, str], dict[float, list[float]]] = {}
    for row in study:
        shares = found.setdefault((row["observer"], row["sweep"]), {})
        shares.setdefault(float(row["level"]), []).append(float(row["value"]))
    return found


_SUMMARIES = {"neighbourhood": _neighbourhood, "changes": _changes, "closeness": _closeness}
