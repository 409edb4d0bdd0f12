"""Stage metrics: how well state and delay are estimated, at rest and while the delay moves."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reobserve.ledger.figure_data import FigureData
from reobserve.papers.delay.scoring import constant_segments, errors, ripple, turned_over_at
from reobserve.papers.delay.setup import UNITS
from reobserve.scoring.metrics import Metric, Score, scores_of
from reobserve.scoring.responses import root_mean_square, window


def measure(data: FigureData) -> Iterator[Metric]:
    """The numbers of a figure; see `MEANINGS`."""
    plant = data.plant
    if data.job.scenario.model == "pendulum":
        yield Metric("plant", "turned_over_at", turned_over_at(plant), "s")
        yield Metric("plant", "largest_angle", float(np.max(np.abs(plant["state"][:, 0]))), "rad")
    for name in data.estimates:
        yield from scores_of(name, _scores(data, name))
    if data.study:  # the mean over the runs at each level
        coordinates = ("observer", "quantity", "unit", "sweep", "level")
        for (name, quantity, unit, sweep, level), runs in data.study.groups(*coordinates):
            score = quantity, float(np.mean(runs["value"])), unit
            yield Metric.at(name, score, **{sweep: level})


def _scores(data: FigureData, name: str) -> Iterator[Score]:
    plant, estimate, rules = data.plant, data.estimates[name], data.job.metrics
    time, error = estimate.time, errors(plant, estimate)
    later = window(time, rules.start, np.inf)
    if "state" in error:
        units = UNITS[data.job.scenario.model][0].split(", ")
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
