"""Stage metrics: how large an error is and how it decays, by observer, and the study in brief."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from reobserve.ledger.types import Job, Settings, read_job
from reobserve.papers.lie import keys
from reobserve.papers.lie.scoring import decay_rate, integral_of_squares, settling_time
from reobserve.papers.lie.study_rows import table
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
    rules = job.metrics
    found = [
        Metric(name, *numbers)
        for name, estimate in estimates.items()
        for numbers in _judge(rules, plant, estimate)
    ]
    if study is not None:
        found += _FROM_STUDY[job.study.method](job, study)
    return found


def _judge(
    rules: keys.Metrics, plant: Series, estimate: Series
) -> Iterator[tuple[str, float, str]]:
    step = estimate.step
    error = estimate["state"] - plant["state"][:: round(step / plant.step)]
    squares = integral_of_squares(error, step)
    size = np.linalg.norm(error, axis=1)
    for i, value in enumerate(squares):
        yield f"ise_{i + 1}", float(value), "s"
    yield "ise", float(squares.sum()), "s"
    for i, value in enumerate(np.max(np.abs(error), axis=0)):
        yield f"peak_error_{i + 1}", float(value), "1"
    yield "peak_error", float(np.max(size)), "1"
    yield "final_error", float(size[-1]), "1"
    yield "settling_time", settling_time(error, step, rules.settling_band), "s"
    yield "decay_rate", decay_rate(error, step, *rules.decay_window), "1/s"


def _orders(job: Job, study: Rows) -> Iterator[Metric]:
    """All of the study where a figure draws it; else the exponents of the figure's observers."""
    values = table(study)
    for quantity, unit in (("period", "s"), ("mean_square_output", "1")):
        yield Metric("cycle", quantity, values["cycle", quantity][0][0], unit)
    if job.figure.layout == "orders":
        for row in study:
            if row["form"] != "cycle":
                name = f"{row['quantity']}_order_{int(row['order'])}"
                yield Metric(row["form"], name, float(row["value"]), row["unit"])
        return
    for name, observer in job.observers.items():
        form = name if (name, "ise") in values else getattr(observer, "gain", "")
        exponents = values.get((form, "floquet_exponent"), {})
        if observer.order in exponents:
            yield Metric(name, "floquet_exponent", exponents[observer.order][0], "1/s")


def _domain(_: Job, study: Rows) -> Iterator[Metric]:
    """The summaries of the study, those of a series named after its degree."""
    for row in study:
        if row["x1"] == "":
            degree = f"_degree_{row['order']}" if row["form"] in ("S", "T") else ""
            yield Metric(
                row["form"], f"{row['quantity']}{degree}", float(row["value"]), row["unit"]
            )


def _ensemble(_: Job, study: Rows) -> Iterator[Metric]:
    """Over all initial states: which share is better than the constant gain, settles, diverges."""
    values = table(study)
    reference = np.array(values["constant", "ise"][0])
    for form, quantity in values:
        if quantity != "ise":
            continue
        for order, squares in values[form, "ise"].items():
            ise = np.array(squares)
            settled = float(np.mean(values[form, "settled"][order]))
            diverged = float(np.mean(values[form, "diverged"][order]))
            with np.errstate(invalid="ignore"):
                better = float(np.mean(ise < reference))
            ratios = np.where(np.isnan(ise), np.inf, ise) / reference
            yield Metric(form, f"share_better_{order}", better, "1")
            yield Metric(form, f"share_settled_{order}", settled, "1")
            yield Metric(form, f"share_diverged_{order}", diverged, "1")
            for name, ratio in (("median", np.median(ratios)), ("least", np.min(ratios))):
                value = float(ratio) if np.isfinite(ratio) else float("nan")
                yield Metric(form, f"{name}_ise_ratio_{order}", value, "1")


_FROM_STUDY = {"orders": _orders, "ensemble": _ensemble, "domain": _domain}
