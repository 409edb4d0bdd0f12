"""Stage metrics: how well state and delay are estimated, at rest and while the delay moves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from reobserve.ledger.types import Settings, read_job
from reobserve.papers.delay import keys
from reobserve.papers.delay.scoring import (
    constant_segments,
    errors,
    ripple,
    root_mean_square,
    turned_over_at,
)
from reobserve.papers.delay.setup import UNITS
from reobserve.scoring.metrics import Metric, window
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
    rules = job.metrics
    found = []
    if job.scenario.model == "pendulum":
        found.append(Metric("plant", "turned_over_at", turned_over_at(plant), "s"))
        peak = float(np.max(np.abs(plant["state"][:, 0])))
        found.append(Metric("plant", "largest_angle", peak, "rad"))
    for name, estimate in estimates.items():
        unit = UNITS[job.scenario.model][0]
        found += [Metric(name, *numbers) for numbers in _judge(rules, plant, estimate, unit)]
    if study is not None:
        found += _brief(study)
    return found


def _judge(
    rules: keys.Metrics, plant: Series, estimate: Series, unit: str
) -> Iterator[tuple[str, float, str]]:
    time, error = estimate.time, errors(plant, estimate)
    later = window(time, rules.start, np.inf)
    if "state" in error:
        units = unit.split(", ")
        for when, chosen in (("", later), ("_from_start", slice(None))):
            for i, value in enumerate(root_mean_square(error["state"][chosen])):
                yield f"rms_error_{i + 1}{when}", float(value), units[i]
    if "delay" not in error:
        return
    off = error["delay"]
    yield "rms_delay_error", float(root_mean_square(off[later])), "s"
    yield "rms_delay_error_from_start", float(root_mean_square(off)), "s"
    for number, start, end in constant_segments(plant, rules.late):
        late = off[window(time, start, end)]
        yield f"late_delay_error_{number}", float(np.max(np.abs(late))), "s"
    moving = off[window(time, *rules.varying)]
    yield "varying_rms_delay_error", float(root_mean_square(moving)), "s"
    yield "varying_peak_delay_error", float(np.max(np.abs(moving))), "s"
    for number, start, end in constant_segments(plant, rules.ripple):
        chosen = window(time, start, end)
        yield f"ripple_{number}", ripple(time[chosen], estimate["delay"][chosen]), "s"
    yield "least_delay", float(np.min(estimate["delay"])), "s"
    yield "greatest_delay", float(np.max(estimate["delay"])), "s"
    if "off" in estimate.channels:
        yield "off_share", float(np.mean(estimate["off"][1:])), "1"


def _brief(study: Rows) -> Iterator[Metric]:
    """The mean over runs of each quantity, named after what is swept and its level."""
    groups: dict[tuple[str, str, str, str], list[float]] = {}
    for row in study:
        key = (
            row["observer"],
            row["quantity"],
            f"{row['sweep']}_{float(row['level']):g}",
            row["unit"],
        )
        groups.setdefault(key, []).append(float(row["value"]))
    for (observer, quantity, place, unit), values in groups.items():
        yield Metric(observer, f"{quantity}_at_{place}", float(np.mean(values)), unit)
