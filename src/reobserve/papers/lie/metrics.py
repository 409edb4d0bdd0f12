"""Stage metrics: how large an error is and how it decays, by observer, and the study in brief."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reobserve.ledger.figure_data import FigureData
from reobserve.papers.lie.scoring import decay_rate, integral_of_squares, settling_time
from reobserve.scoring.metrics import Metric, Score, scores_of
from reobserve.scoring.responses import error_of


def measure(data: FigureData) -> Iterator[Metric]:
    """The numbers of a figure; see `MEANINGS`."""
    for name in data.estimates:
        yield from scores_of(name, _scores(data, name))
    yield from _FROM_STUDY[data.job.study.method](data)


def _scores(data: FigureData, name: str) -> Iterator[Score]:
    rules, estimate = data.job.metrics, data.estimates[name]
    step, error = estimate.step, error_of(data.plant, estimate, "state")
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


def _orders(data: FigureData) -> Iterator[Metric]:
    """All of the study where a figure draws it; else the exponents of the figure's observers."""
    study, job = data.study, data.job
    for quantity, unit in (("period", "s"), ("mean_square_output", "1")):
        yield Metric("cycle", quantity, study.value(form="cycle", quantity=quantity), unit)
    if job.figure.layout == "orders":
        for (form, order, quantity, unit), rows in study.groups(
            "form", "order", "quantity", "unit"
        ):
            if form != "cycle":
                yield Metric.at(form, (quantity, rows.value(), unit), order=order)
        return
    for name, observer in job.observers.items():
        own = name in study["form"]
        form = name if own else getattr(observer, "gain", "")
        found = study.where(form=form, quantity="floquet_exponent", order=observer.order)
        for value in found["value"]:
            yield Metric(name, "floquet_exponent", float(value), "1/s")


def _domain(data: FigureData) -> Iterator[Metric]:
    """The summaries of the study, those of a series at their degree."""
    study = data.study
    for (form, order, quantity, unit), rows in study.groups("form", "order", "quantity", "unit"):
        if np.isnan(rows["x1"]).all():
            degree = {"degree": order} if form in ("S", "T") else {}
            yield Metric.at(form, (quantity, rows.value(), unit), **degree)


def _ensemble(data: FigureData) -> Iterator[Metric]:
    """Over all initial states: which share is better than the constant gain, settles, diverges."""
    study = data.study
    reference = study.where(form="constant", quantity="ise")["value"]
    for (form, order), rows in study.groups("form", "order"):
        ise, settled, diverged = (
            rows.where(quantity=quantity)["value"] for quantity in ("ise", "settled", "diverged")
        )
        with np.errstate(invalid="ignore"):
            better = ise < reference
        for what, states in (("better", better), ("settled", settled), ("diverged", diverged)):
            yield Metric.at(form, (f"share_{what}", float(np.mean(states)), "1"), order=order)
        ratios = np.where(np.isnan(ise), np.inf, ise) / reference
        for name, ratio in (("median", np.median(ratios)), ("least", np.min(ratios))):
            value = float(ratio) if np.isfinite(ratio) else float("nan")
            yield Metric.at(form, (f"{name}_ise_ratio", value, "1"), order=order)


_FROM_STUDY = {"orders": _orders, "ensemble": _ensemble, "domain": _domain}
