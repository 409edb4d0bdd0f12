"""Stage metrics: how large an error is and how it decays, by observer, and the study in brief.

e is the estimate minus the state. `ise` and what follows stand for each observer of a figure; those
with an order or a degree at the end summarise the study behind it, where the observer column holds
the reading of the gain, the series or `cycle`, the limit cycle. From `eigenvalue_<part>` on they
are those of the theory, where it holds the injection, the kind of systems or the formula that is
judged. `nan` means that it never happens.
"""

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

# What each number is, those of the theory included; `<word>` stands for what differs.
MEANINGS = {
    "ise": "integral of |e|^2 over time",
    "ise_<component>": "the same of one component",
    "peak_error": "largest |e|",
    "peak_error_<component>": "the same of one component",
    "final_error": "|e| at the end",
    "settling_time": "until |e| stays below two per cent of its first value",
    "decay_rate": "mean slope of log |e| over a turn of the limit cycle",
    "floquet_exponent": "largest one of a small error on the limit cycle",
    "period": "of the limit cycle",
    "mean_square_output": "mean of y^2 over the limit cycle",
    "ise_order_<order>": "`ise` of an order; `nan` where the run diverges",
    "settling_time_order_<order>": "`settling_time` of an order",
    "diverged_at_order_<order>": "last time at which the estimate is finite",
    "floquet_exponent_order_<order>": "`floquet_exponent` of an order",
    "share_better_<order>": "of initial states, with an `ise` below that of the constant gain",
    "share_settled_<order>": "of initial states, from which e settles within the run",
    "share_diverged_<order>": "of initial states, from which the estimate leaves all bounds",
    "median_ise_ratio_<order>": "median of `ise` over that of the constant gain",
    "least_ise_ratio_<order>": "the same from the initial state where it is least",
    "distance": "of the limit cycle from the origin",
    "outside_share": "of points at the edge of the domain of convergence of S, or outside",
    "radius_degree_<degree>": "estimated radius of convergence of S from its parts up to a degree",
    "largest_error_degree_<degree>": "of S(x) or T(z), cut off at a degree, on the limit cycle",
    "eigenvalue_<part>": "real and largest imaginary part of the eigenvalues of A",
    "largest_real_part": "of the eigenvalues of a small error's dynamics",
    "coefficients_printed": "how many coefficients of T(z) the paper prints",
    "coefficients_agreeing": "how many exact ones round to them",
    "imaginary_part": "largest left over of a real part of S or T, relative to its size",
    "largest_difference": "of S, T or L between Lie transform and direct roads, over fractions",
    "largest_residual": "largest coefficient left in the equation for S, over fractions",
    "deviation": "of z - S(x) from e^(A t) times its first value, relative to that",
    "form_difference": "largest distance between estimates in z and in identity form",
    "inverse_radius": "of the ball where S converges; 0 where the series ends",
    "ise_ratio": "`ise` of the nonlinear injection over that of order 4",
    "first_wrong_degree": "of T by (22), on the example",
    "first_wrong_degree_random": "the same on a random system with terms of all degrees",
    "spectrum_difference": "largest from an eigenvalue of ad_A to those of Lemma 4.17",
    "off_diagonal": "largest entry of ad_A beside its diagonal for a diagonal A",
    "lowest_degree_<series>": "of the terms beyond x, for a system with quadratic terms",
    "share_unobservable": "of random systems, with a mode that the output does not show",
    "smallest_eigenvalue": "of ad_A in absolute value",
    "solvable": "1 where the equation for S has one solution, else 0",
    "share": "of blind choices of poles, with divisors above a hundredth of their terms",
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
