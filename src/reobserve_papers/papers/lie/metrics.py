"""Stage metrics: size and decay of the error by observer, and a summary of the study.

e is the estimate minus the state. The first metrics, from `ise` on, belong to an observer of a
figure. Those at an order or a degree summarise the study of the figure. There the observer column
holds the kind of the gain, `transformed`, the series, `cubic` for a set of injections, or `cycle`
for the limit cycle. From `radius_ratio` on they belong to the theory, where it holds the injection,
the form, or the kind of systems. `nan` means that it never happens.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from reobserve_papers.metrics.metrics import Metric, Score, scores_of
from reobserve_papers.metrics.responses import error_of
from reobserve_papers.papers.lie import keys
from reobserve_papers.papers.lie.scoring import (
    decay_rate,
    integral_of_squares,
    ratios,
    settling_time,
    share_better,
)
from reobserve_papers.parameters.figure_data import FigureData

# By layout of a figure: what its numbers are of, beside observers.
SUBJECTS = {
    "errors": "copy cycle",
    "forms": "copy cycle",
    "orders": "composed copy cycle jacobian series",
    "ensemble": "jacobian series transformed",
    "injections": "cubic",
    "domain": "S T cycle plant",
    "theory": (
        "ad brute_force copy identity lie linear nonlinear nonresonant over_copy random "
        "remark_3_7 remark_4_19 siegel transformed unobservable"
    ),
}

# What each number is, those of the theory included; `<word>` stands for what differs.
MEANINGS = {
    "ise": "integral of |e|^2 over time",
    "ise_<component>": "the same of one component",
    "settling_time": "time until |e| stays below two per cent of its initial value",
    "floquet_exponent": "largest one of a small error on the limit cycle",
    "period": "of the limit cycle",
    "ise order=<order>": "`ise` of an order; `nan` where the run diverges",
    "settling_time order=<order>": "`settling_time` of an order",
    "diverged_at order=<order>": "last time at which the estimate is finite",
    "floquet_exponent order=<order>": "`floquet_exponent` of an order",
    "share_better order=<order>": (
        "of initial states, with an `ise` below that of the constant gain"
    ),
    "share_settled order=<order>": "of initial states, from which e settles within the run",
    "share_diverged order=<order>": "of initial states, from which the estimate diverges",
    "median_ise_ratio order=<order>": "median of `ise` over that of the constant gain",
    "minimum_ise_ratio order=<order>": "the same from the initial state with the minimum ratio",
    "distance": "minimum distance of the limit cycle from the origin",
    "<extreme>_growth": "factor by which the parts of S grow with the degree; below 1 they shrink",
    "radius degree=<degree>": "estimated radius of convergence of S from its parts up to a degree",
    "largest_error degree=<degree>": "of S(x) or T(z), truncated at a degree, on the limit cycle",
    "radius_ratio": "of the radius at the highest degree to that at half of it",
    "eigenvalue_error": "largest distance of real or imaginary part of A's from what is printed",
    "coefficients_printed": "number of coefficients of T(z) that the paper prints",
    "coefficients_agreeing": "number of exact ones that round to them",
    "imaginary_part": "largest left over of a real part of S or T, relative to its size",
    "largest_difference": "of S, T or L between Lie transform and direct methods, over fractions",
    "series_exists": "1 if S exists where A is nonresonant with itself and a sum of F's, else 0",
    "smallest_eigenvalue": "smallest size of an eigenvalue of ad_A at degree 3",
    "largest_residual": "largest coefficient left in the equation for S, over fractions",
    "deviation": "of z - S(x) from e^(A t) times its first value, relative to that",
    "form_difference": "largest distance between estimates in z and in identity form",
    "inverse_radius": "of the ball where S converges; 0 where the series ends",
    "spectrum_difference": "largest from an eigenvalue of ad_A to those of Lemma 4.17",
    "off_diagonal": "largest off-diagonal entry of ad_A for a diagonal A",
    "share": "of random linear parts, with poles found whose divisors are above a margin",
    "share states=<states>": "the same with more states than two",
    "operations degree=<degree>": (
        "sums, products and quotients of fractions for T up to a degree, the gain of the Lie "
        "transform and its equations as `theory.lie_gain` and `theory.lie_equations` state, brute "
        "force as `theory.brute_force` does, with elimination"
    ),
    "operations degree=<degree> equations=alike": (
        "the same of brute force with equations as `theory.lie_equations` states"
    ),
    "decay_rate": "mean slope of log |e| over a turn of the limit cycle; of the theory, of |xi|",
    "error_decay": "mean slope of log |T(z) - x| near the origin; the slowest of random systems",
    "error_decay growth=<growth>": "the same until the state has grown by this factor, not ten",
    "share_better": "of initial states, with an `ise` below that of the constant gain",
    "share_better measure=<absolute,settling,square>": (
        "of initial states, from which the error is smaller than with the constant gain, by the "
        "integral of its square (square) or absolute value (absolute), or by when it settles "
        "(settling)"
    ),
    "share_settled": "of initial states, from which e settles within the run",
    "latest_settling_time": "largest `settling_time` over initial states; `nan` if one is",
    "share_better_at_order_0 measure=<absolute,settling,square>": (
        "the same of the nonlinear injection at order 0"
    ),
    "largest_improvement measure=<absolute,settling,square>": (
        "on the constant gain by that error, in any run"
    ),
    "share_mostly_better": "of cubic injections, better than the constant gain from most states",
    "minimum_median_ise_ratio": "minimum over cubic injections",
    "median_ise_ratio": "median over initial states of `ise` over that of the constant gain",
}


def measure(data: FigureData[keys.Job]) -> Iterator[Metric]:
    """The numbers of a figure (see `MEANINGS`)."""
    for name in data.estimates:
        yield from scores_of(name, _scores(data, name))
    yield from _FROM_STUDY[data.job.study.method](data)


def _scores(data: FigureData[keys.Job], name: str) -> Iterator[Score]:
    rules, estimate = data.job.metrics, data.estimates[name]
    step, error = estimate.step, error_of(data.plant, estimate, "state")
    squares = integral_of_squares(error, step)
    for i, value in enumerate(squares):
        yield f"ise_{i + 1}", float(value), "s"
    yield "ise", float(squares.sum()), "s"
    yield "settling_time", settling_time(error, step, rules.settling_band), "s"
    yield "decay_rate", decay_rate(error, step, *rules.decay_window), "1/s"


def _orders(data: FigureData[keys.Job]) -> Iterator[Metric]:
    """The whole study if the figure shows it, else the exponents of the figure's observers."""
    study, job = data.study, data.job
    yield Metric("cycle", "period", study.value(form="cycle", quantity="period"), "s")
    if job.figure.layout == "orders":
        for (form, order, quantity, unit), rows in study.groups(
            "form", "order", "quantity", "unit"
        ):
            if form != "cycle":
                yield Metric.at(form, (quantity, rows.value(), unit), order=order)
        return
    for name, observer in job.observers.items():
        own = name in study["form"]
        if not own and observer.design != job.study.design:
            continue
        form = name if own else getattr(observer, "gain", "")
        matching = study.where(form=form, quantity="floquet_exponent", order=observer.order)
        for value in matching["value"]:
            yield Metric(name, "floquet_exponent", float(value), "1/s")
    copy = study.value(form="copy", quantity="floquet_exponent")
    yield Metric("copy", "floquet_exponent", copy, "1/s")


def _domain(data: FigureData[keys.Job]) -> Iterator[Metric]:
    """The summaries of the study, those of a series at their degree."""
    study = data.study
    for (form, order, quantity, unit), rows in study.groups("form", "order", "quantity", "unit"):
        if np.isnan(rows["x1"]).all():
            degree = {"degree": order} if order else {}
            yield Metric.at(form, (quantity, rows.value(), unit), **degree)


def _ensemble(data: FigureData[keys.Job]) -> Iterator[Metric]:
    """Shares of initial states: better than the constant gain, settled, diverged."""
    study = data.study
    reference = study.where(form="constant", quantity="ise")["value"]
    for (form, order), rows in study.groups("form", "order"):
        ise, settled, diverged = (
            rows.where(quantity=quantity)["value"] for quantity in ("ise", "settled", "diverged")
        )
        shares = {
            "better": share_better(ise, reference),
            "settled": float(np.mean(settled)),
            "diverged": float(np.mean(diverged)),
        }
        for what, share in shares.items():
            yield Metric.at(form, (f"share_{what}", share, "1"), order=order)
        quotients = ratios(ise, reference)
        for name, ratio in (("median", np.median(quotients)), ("minimum", np.min(quotients))):
            value = float(ratio) if np.isfinite(ratio) else float("nan")
            yield Metric.at(form, (f"{name}_ise_ratio", value, "1"), order=order)


def _injections(data: FigureData[keys.Job]) -> Iterator[Metric]:
    """The study's observers: share of mostly better cubic injections, and the best median."""
    study = data.study
    for name in data.job.study.observers:
        for (quantity,), rows in study.where(form=name).groups("quantity"):
            yield Metric(name, quantity, rows.value(), "1")
    cubic = study.where(form="cubic")
    shares = cubic.where(quantity="share_better")["value"]
    medians = cubic.where(quantity="median_ise_ratio")["value"]
    yield Metric("cubic", "share_mostly_better", float(np.mean(shares > 0.5)), "1")
    yield Metric("cubic", "minimum_median_ise_ratio", float(np.fmin.reduce(medians)), "1")


_FROM_STUDY = {
    "orders": _orders,
    "ensemble": _ensemble,
    "domain": _domain,
    "injections": _injections,
}
