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
from reobserve_papers.metrics.responses import root_mean_square, scored
from reobserve_papers.papers.delay import keys
from reobserve_papers.papers.delay.observe import estimate
from reobserve_papers.papers.delay.plant import simulate
from reobserve_papers.papers.delay.scoring import constant_segments, errors, rms_scores
from reobserve_papers.papers.delay.study_rows import HEADER
from reobserve_papers.parameters.job import named
from reobserve_papers.signals.series import Series

Row = tuple[str, str, float, int, str, float, str]


def run(job: keys.Job, plant: Series) -> list[dict[str, Any]]:
    """The rows of the study's method, with the columns of `HEADER`."""
    match job.study:
        case keys.Tradeoff() as study:
            rows = tradeoff(job, study, plant)
        case keys.Tuning() as study:
            rows = tuning(job, study, plant)
    return [dict(zip(HEADER, row, strict=True)) for row in rows]


def tradeoff(job: keys.Job, study: keys.Tradeoff, plant: Series) -> Iterator[Row]:
    """RMS errors of delay and states for each observer, rho and run, where run 0 has no noise.

    Run 1 has the noise of ``plant``.
    """
    observers = {k: v for k, v in job.observers.items() if isinstance(v, keys.HighGain)}
    for number in range(study.runs + 1):
        record = plant
        if number == 0:
            quiet = replace(job.scenario, noise_share=0.0)
            record = simulate(replace(job, scenario=quiet))
        elif number > 1:
            record = simulate(replace(job, seed=job.seed + number - 1))
        for name, body in observers.items():
            for rho in study.rhos:
                changed = replace(body, rho=rho, sampling_period=study.sampling_period)
                with located(f"observers.{name}"):
                    result = estimate(keys.Job(job.plant, observer=changed), record)
                sweep = "noise_rho" if number else "rho"
                for quantity, value, unit in rms_scores(job.metrics, body.model, record, result):
                    if "start" not in quantity:
                        yield name, sweep, rho, number, quantity, value, unit


# The observers of the study of tuning, by name and type.
TUNED: dict[str, type] = {
    "extended_lag": keys.Extended,
    "least_squares": keys.LeastSquares,
    "adaptive": keys.AdaptiveIdentification,
    "relay": keys.Relay,
}


def tuning(job: keys.Job, study: keys.Tuning, plant: Series) -> Iterator[Row]:
    """RMS errors of the delay at rest (before each jump) and varying, by method and level."""
    for name, parameter, levels, observers in _tuned(job, study):
        for level, observer in observers:
            with located(f"studies.tuning.{levels}, {name}"):
                result = estimate(keys.Job(job.plant, observer=observer), plant)
            for quantity, value in _tuning_scores(job.metrics, plant, result):
                yield name, parameter, float(level), 0, quantity, value, "s"


Levels = list[tuple[float, keys.Observer]]


def _tuned(job: keys.Job, study: keys.Tuning) -> Iterator[tuple[str, str, str, Levels]]:
    """The varied parameter of each method, the key of its levels, and the observer at each."""
    tuned: Levels
    extended = named(job.observers, "extended_lag", keys.Extended)
    tuned = [(level, replace(extended, rho=level)) for level in study.rhos]
    yield "extended_lag", "rho", "rhos", tuned
    squares = named(job.observers, "least_squares", keys.LeastSquares)
    tuned = [(level, replace(squares, forgetting=level)) for level in study.forgetting]
    yield "least_squares", "forgetting", "forgetting", tuned
    base = named(job.observers, "adaptive", keys.AdaptiveIdentification)
    tuned = []
    for level in study.forgetting:
        # In proportion to the forgetting, including the tuning of Fig. 3.
        gain = base.adaptation_gain * level / base.forgetting
        tuned.append((level, replace(base, forgetting=level, adaptation_gain=gain)))
    yield "adaptive", "forgetting", "forgetting", tuned
    relay = named(job.observers, "relay", keys.Relay)
    tuned = [(level, replace(relay, relay_gain=level)) for level in study.relay_gains]
    yield "relay", "relay_gain", "relay_gains", tuned


def _tuning_scores(
    rules: keys.Metrics, plant: Series, estimate: Series
) -> Iterator[tuple[str, float]]:
    error = errors(plant, estimate)["delay"]
    resting = np.zeros(len(error), dtype=bool)
    for _, start, end in constant_segments(plant, rules.late):
        resting |= scored("metrics.late", estimate.time, start, end)
    yield "resting_rms_delay_error", float(root_mean_square(error[resting]))
    varying = rules.varying_from, rules.varying_until
    moving = scored("metrics.varying_from", estimate.time, *varying)
    yield "varying_rms_delay_error", float(root_mean_square(error[moving]))
