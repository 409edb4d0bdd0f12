"""Stage study: a table of many runs for one figure.

The ``method`` of a study in the parameter file is one of

    tradeoff    errors against rho, for both Taylor orders and the standard observer, without and
                with noise; the observers are those of Fig. 2, so the level of its rho repeats
                Fig. 2 with other noise
    tuning      errors of the four methods of Fig. 3 against the tuning of each
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from reobserve.core.errors import located
from reobserve_papers.metrics.responses import root_mean_square, window
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.observe import estimate
from reobserve_papers.papers.delay.plant import simulate
from reobserve_papers.papers.delay.scoring import constant_segments, errors, rms_scores
from reobserve_papers.papers.delay.study_rows import HEADER
from reobserve_papers.parameters.job import Job, Settings, named, read_job
from reobserve_papers.signals.series import Series

Row = tuple[str, str, float, int, str, float, str]


def run(settings: Settings, plant: Series) -> list[dict[str, Any]]:
    """The rows of the study's method, with the columns of `HEADER`.

    Raises
    ------
    InputError
        If there is no such method or a setting cannot be used.
    """
    job = read_job(keys.Parameters, settings)
    methods = {"tradeoff": tradeoff, "tuning": tuning}
    return [dict(zip(HEADER, row, strict=True)) for row in methods[job.study.method](job, plant)]


def tradeoff(job: Job, plant: Series) -> Iterator[Row]:
    """For each observer, rho and run: RMS errors of delay and states; run 0 is without noise.

    Run 1 has the noise of ``plant``.

    Raises
    ------
    InputError
        If a setting cannot be used.
    """
    study = job.study
    for number in range(study.runs + 1):
        record = plant
        if number == 0:
            quiet = replace(job.scenario, noise_share=0.0)
            record = simulate(replace(job, scenario=quiet))
        elif number > 1:
            record = simulate(replace(job, seed=job.seed + number - 1))
        for name, body in job.observers.items():
            for rho in study.rhos:
                changed = replace(body, rho=rho, sampling_period=study.sampling_period)
                with located(f"observers.{name}"):
                    found = estimate(Job(job.plant, observer=changed), record)
                sweep = "noise_rho" if number else "rho"
                for quantity, value, unit in rms_scores(job.metrics, body.model, record, found):
                    if "start" not in quantity:
                        yield name, sweep, rho, number, quantity, value, unit


# For each observer: its type, the varied parameter, and the key of the study's levels.
SWEEPS: dict[str, tuple[type, str, str]] = {
    "extended_lag": (keys.Extended, "rho", "rhos"),
    "least_squares": (keys.LeastSquares, "forgetting", "forgetting"),
    "adaptive": (keys.AdaptiveIdentification, "forgetting", "forgetting"),
    "relay": (keys.Relay, "relay_gain", "relay_gains"),
}


def tuning(job: Job, plant: Series) -> Iterator[Row]:
    """RMS errors of the delay at rest (before each jump) and varying, by method and level.

    Raises
    ------
    InputError
        If an observer or a level cannot be used.
    """
    study, observers, rules = job.study, job.observers, job.metrics
    for name, (kind, parameter, levels) in SWEEPS.items():
        stated = named(observers, name, kind)
        for level in getattr(study, levels):
            changed = {parameter: level}
            if name == "adaptive":
                # In proportion to the forgetting, including the tuning of Fig. 3.
                changed["adaptation_gain"] = stated.adaptation_gain * level / stated.forgetting
            with located(f"studies.tuning.{levels}, {name}"):
                found = estimate(Job(job.plant, observer=replace(stated, **changed)), plant)
            for quantity, value in _tuning_scores(rules, plant, found):
                yield name, parameter, float(level), 0, quantity, value, "s"


def _tuning_scores(
    rules: keys.Metrics, plant: Series, found: Series
) -> Iterator[tuple[str, float]]:
    error = errors(plant, found)["delay"]
    resting = np.zeros(len(error), dtype=bool)
    for _, start, end in constant_segments(plant, rules.late):
        resting |= window(found.time, start, end)
    yield "resting_rms_delay_error", float(root_mean_square(error[resting]))
    moving = window(found.time, rules.varying_from, rules.varying_until)
    yield "varying_rms_delay_error", float(root_mean_square(error[moving]))
