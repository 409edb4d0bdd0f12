"""Stage metrics: errors and lags of the estimated faults, and what the certificates say.

Errors are estimates minus faults, over the windows of the ledger in which a fault varies or is
constant. A number behind `_at_` belongs to a design of the study, named after the filter's rate,
what was chosen and its level; there the observer column holds the kind of design, and errors are
without disturbance and noise. In `theory` the observer column holds an observer or what is judged:
the motor (also with the sign of the paper), one or both outputs, a sensor fault that looks like the
actuator's, any observer, and so on.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from reobserve.ledger.types import Settings, read_job
from reobserve.papers.eso import keys
from reobserve.papers.eso.scoring import check_rules, scores
from reobserve.scoring.metrics import Metric
from reobserve.timeseries.series import Series

Rows = Sequence[Mapping[str, Any]]

# What each number is, those of the theory included; `<word>` stands for what differs.
MEANINGS = {
    "rms_<fault>_error_<when>": "root mean square error of a fault where it varies or is constant",
    "mean_<fault>_error_<when>": "its mean",
    "<fault>_lag": "shift of the estimate that leaves the least error",
    "<quantity>_at_rate_<rate>_<choice>_<level>": "the same of a design of the study",
    "<source>_in_<fault>_fault_at_rate_<rate>_<choice>_<level>": (
        "standard deviation that disturbances or noise cause"
    ),
    "norm_at_rate_<rate>_<choice>_<level>": "proved bound of the H-infinity norm",
    "largest_gain_at_rate_<rate>_<choice>_<level>": "largest entry of L",
    "<which>_pole_at_rate_<rate>_<choice>_<level>": (
        "distance of the slowest or fastest pole from the axis"
    ),
    "slowest_pole": "distance of the slowest pole from the axis",
    "unobservable_states": "states less the rank of the observability matrix of (A, C)",
    "undetermined_faults": "combinations of constant states and faults that no output shows",
    "overshoot": "of the speed after a step of the reference by one",
    "settling_time": "of the speed, until it stays within two per cent",
    "gamma_floor": "least H-infinity norm that any gains can have",
    "disturbance_floor": "the same from disturbances alone, without noise",
    "filter_rate_effect": "largest relative change of `gamma_floor` by the rate of the filter",
    "lemma_difference": "of (19) from (18) for random matrices, relative to the largest entry",
    "gain_difference": "of gains recovered from P and Y, as relative",
    "deviation": "of the noise",
    "norm": "proved bound of the H-infinity norm",
    "gamma": "bound that was asked for; `nan` for designs without one",
    "infinite_poles": "of the error dynamics as a descriptor system",
    "margin_above_norm": (
        "how far below zero (19) can be at a gamma just above the norm; 0 if nowhere"
    ),
    "missed_<fault>_fault": "part of a sine with the fault's frequency that its estimate misses",
    "missed_<fault>_fault_when_fast": "the same of one that is `theory.fast_fault` times as fast",
    "noise_in_<fault>_fault": "standard deviation that noise causes in the estimate",
    "<source>_disturbance_left": (
        "deviation that a random disturbance causes, over the error by a constant one"
    ),
    "bias_of_<fault>_fault_reading_<reading>": (
        "mean error by disturbances in the ranges of one reading"
    ),
    "controller_effect_on_<fault>_fault": "largest change of the estimate by another controller",
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
    check_rules(job.metrics, job.plant)
    found = []
    for name, estimate in estimates.items():
        found += [Metric(name, *score) for score in scores(job.metrics, plant, estimate)]
    if study is not None:
        found += _brief(study)
    return found


def _brief(study: Rows) -> Iterator[Metric]:
    """Each number of a design, named after what was chosen."""
    for row in study:
        place = f"rate_{float(row['filter_rate']):g}_{row['choice']}_{float(row['level']):g}"
        yield Metric(row["kind"], f"{row['quantity']}_at_{place}", float(row["value"]), row["unit"])
