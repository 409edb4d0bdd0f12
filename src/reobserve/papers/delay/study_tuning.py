"""The four methods of Fig. 3 against the tuning of each: what is a property, what a choice."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from reobserve.core.errors import located
from reobserve.papers.delay import keys
from reobserve.papers.delay.observe import estimate
from reobserve.papers.delay.scoring import constant_segments, errors
from reobserve.replication.metrics.responses import root_mean_square, window
from reobserve.replication.parameters.job import Job, named
from reobserve.signals.series import Series

Row = tuple[str, str, float, int, str, float, str]


# What is swept of each observer: its kind, its parameter, and the study's levels.
SWEEPS: dict[str, tuple[type, str, str]] = {
    "extended_lag": (keys.Extended, "rho", "rhos"),
    "least_squares": (keys.LeastSquares, "forgetting", "forgetting"),
    "adaptive": (keys.Adaptive, "forgetting", "forgetting"),
    "relay": (keys.Relay, "relay_gain", "relay_gains"),
}


def run(job: Job, plant: Series) -> list[Row]:
    """RMS errors of the delay at rest (before each jump) and varying, by method and level.

    Raises
    ------
    InputError
        If an observer or a level cannot be used.
    """
    study, observers, rules = job.study, job.observers, job.metrics
    rows: list[Row] = []
    for name, (kind, parameter, levels) in SWEEPS.items():
        stated = named(observers, name, kind)
        for level in getattr(study, levels):
            changed = {parameter: level}
            if name == "adaptive":
                # In proportion, so that the forgetting decides, and through the tuning of Fig. 3.
                changed["adaptation_gain"] = stated.adaptation_gain * level / stated.forgetting
            with located(f"studies.tuning.{levels}, {name}"):
                found = estimate(Job(job.plant, observer=replace(stated, **changed)), plant)
            for quantity, value in _scores(rules, plant, found):
                rows.append((name, parameter, float(level), 0, quantity, value, "s"))
    return rows


def _scores(rules: keys.Metrics, plant: Series, found: Series) -> Iterator[tuple[str, float]]:
    error = errors(plant, found)["delay"]
    resting = np.zeros(len(error), dtype=bool)
    for _, start, end in constant_segments(plant, rules.late):
        resting |= window(found.time, start, end)
    yield "resting_rms_delay_error", float(root_mean_square(error[resting]))
    moving = window(found.time, rules.varying_from, rules.varying_until)
    yield "varying_rms_delay_error", float(root_mean_square(error[moving]))
