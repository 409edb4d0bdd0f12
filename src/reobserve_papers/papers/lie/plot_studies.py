"""Figures of the studies: orders, initial states, cubic injections, and where series converge."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from reobserve.core.arguments import as_kind
from reobserve_papers.metrics.study_table import StudyTable
from reobserve_papers.papers.lie import keys
from reobserve_papers.papers.lie.plot_errors import draw_sizes
from reobserve_papers.papers.lie.styles import EDGE, FORMS, GAINS, pair, starts, style_of, vector
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.parameters.job import named
from reobserve_papers.plotting.figures import STYLES, TRUTH, add_note, decades, mosaic, new_figure
from reobserve_papers.plotting.style_sheet import mark, points, thick


def draw_orders(data: FigureData[keys.Job]) -> Figure:
    """ISE, divergence, settling time and largest Floquet exponent over the order of the gain."""
    job, study = data.job, data.study
    orders_shown = as_kind("study", job.study, keys.OrdersStudy).orders
    figure, (ise, lost, settling, floquet) = new_figure((1.6, 0.7, 1.6, 1.8))
    _curves(ise, study, "ise", labelled=False)
    ise.set_yscale("log")
    ise.yaxis.set_major_formatter("{x:g}")
    ise.set_ylabel("ISE [s]")
    ise.set_title("(a) integral of the squared error")
    for place, (form, (style, _)) in enumerate(GAINS.items()):
        runs = study.where(form=form, quantity="diverged_at")
        orders = runs["order"][np.isfinite(runs["value"])]
        lost.plot(
            orders, [place] * len(orders), linestyle="", marker="x", markersize=mark(5),
            color=style.color,
        )  # fmt: skip
    lost.set_ylim(len(GAINS) - 0.4, -0.6)
    lost.set_yticks(range(len(GAINS)), [label for _, label in GAINS.values()], fontsize=points(7))
    lost.set_title("(b) orders with which the estimate diverges")
    _curves(settling, study, "settling_time")
    settling.set_ylabel("settling time [s]")
    band = 100 * job.metrics.settling_band
    settling.set_title(f"(c) time to {band:g} % of the first error; a gap: not within the run")
    settling.legend(loc="upper left")
    _curves(floquet, study, "floquet_exponent", labelled=False)
    floquet.axhline(0.0, color="0.4", linewidth=thick(0.8))
    floquet.axhline(
        study.value(form="injection", quantity="floquet_exponent"),
        color="0.4", linewidth=thick(0.8), linestyle=":", label="nonlinear injection, chosen here",
    )  # fmt: skip
    floquet.legend(loc="lower right")
    floquet.set_ylim(-2.0, 1.0)
    floquet.set_ylabel("exponent [1/s]")
    floquet.set_title(
        "(d) largest Floquet exponent of the error on the limit cycle; above 0 the error grows"
    )
    floquet.set_xlabel("order of the gain")
    floquet.set_xticks(orders_shown)
    period = study.value(form="cycle", quantity="period")
    add_note(
        figure,
        f"Identity form, {starts(job)}. Order 0 is the constant gain; odd orders equal the even "
        f"one below.\nPeriod of the limit cycle "
        f"{period:.5g} s; what is off the scale of (d) grows faster than shown.",
    )
    return figure


def _curves(axes: Axes, study: StudyTable, quantity: str, *, labelled: bool = True) -> None:
    for form, (style, label) in GAINS.items():
        axes.plot(
            *_by_level(study, form, quantity), **style.points(), label=label if labelled else None
        )


def _by_level(study: StudyTable, form: str, quantity: str) -> tuple[Any, Any]:
    """The orders or degrees, and a quantity at each."""
    values = study.where(form=form, quantity=quantity).by_level("order")
    return list(values), [value for (value,) in values.values()]


def draw_ensemble(data: FigureData[keys.Job]) -> Figure:
    """Draw shares that settle and that are better by order, and where that of Fig. 1 is better."""
    job = data.job
    settings = as_kind("study", job.study, keys.EnsembleStudy)
    mapped, estimate = job.observers["order4"].order, job.observers["order4"].initial_estimate
    figure, axes = mosaic(
        [["settled", "plane"], ["better", "plane"]], 4.9,
        stacked={"settled": 2.0, "better": 2.0, "plane": 3.8},
    )  # fmt: skip
    settled, better, plane = axes["settled"], axes["better"], axes["plane"]
    _shares(settled, data, settings.orders, "share_settled")
    settled.set_title(f"(a) settles within {job.plant.horizon:g} s")
    settled.set_ylim(-4, 104)
    _shares(better, data, settings.orders, "share_better")
    better.set_title("(b) smaller ISE than the constant gain")
    better.set_ylim(-2, 70)
    better.set_xlabel("order")
    better.legend(loc="upper right")

    states, smaller = _compare(data.study, mapped)
    for chosen, observer, marker, label in (
        (smaller, "order4", "o", f"order {mapped} has the smaller ISE"),
        (~smaller, "constant", "x", "the constant gain has it"),
    ):
        plane.plot(
            *states[chosen].T, linestyle="", markersize=mark(4), marker=marker, label=label,
            color=style_of(observer).color,
        )  # fmt: skip
    plane.set_aspect("equal")
    plane.set_xlabel("x₁(0)")
    plane.set_ylabel("x₂(0)")
    plane.set_title(f"(c) order {mapped}, series of L, by initial state")
    plane.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13))
    add_note(
        figure,
        f"{len(states)} initial states on a square of half width {settings.half_width:g}, "
        f"x̂(0) = {pair(estimate)}, {job.plant.horizon:g} s. Grid, size and steps are chosen here.\n"
        f"Settled: |e| stays within {100 * job.metrics.settling_band:g} % of its first value.",
    )
    return figure


def _shares(axes: Axes, data: FigureData[keys.Job], orders: Sequence[int], quantity: str) -> None:
    for form, (style, label) in FORMS.items():
        values = [100 * data.metrics.at(form, quantity, order=order) for order in orders]
        axes.plot(orders, values, **style.points(), label=label)
    axes.set_xticks(orders)
    axes.set_ylabel("initial states [%]")


def _compare(study: StudyTable, order: int) -> tuple[Any, Any]:
    """The initial states, and whether the order has the smaller ISE there."""
    ise = study.where(quantity="ise")
    mapped, constant = ise.where(form="series", order=order), ise.where(form="constant")
    states = np.stack([mapped["x1"], mapped["x2"]], axis=1)
    return states, mapped["value"] < constant["value"]


# Limit of the median ratio, up and down. Above it dS/dx becomes singular along the run, and the
# result depends on the step: such injections are black.
_DOUBLINGS = 1.0


def draw_injections(data: FigureData[keys.Job]) -> Figure:
    """Errors over time, and over the square of coefficients the share of states and the median."""
    job, study = data.job, data.study
    figure, axes = mosaic(
        [["size", "size"], ["share", "ratio"]], 5.0, height_ratios=(1.0, 1.25),
        stacked={"size": 2.2, "share": 3.4, "ratio": 3.4},
    )  # fmt: skip
    settings = as_kind("study", job.study, keys.InjectionsStudy)
    shown = as_kind("figure", job.figure, keys.OfInjections).shown
    size, share, ratio = axes["size"], axes["share"], axes["ratio"]
    draw_sizes(size, data, shown)
    size.set_xlabel("time [s]")
    size.set_title("(a) size of the error from the initial state of Fig. 1")
    size.legend(loc="lower left")

    cubic = study.where(form="cubic")
    shares = cubic.where(quantity="share_better")
    _map(figure, share, shares, 100 * shares["value"], "initial states [%]", (0.0, 100.0))
    share.set_title("(b) smaller ISE than the constant gain")
    medians = cubic.where(quantity="median_ise_ratio")
    doublings = np.nan_to_num(np.log2(medians["value"]), nan=_DOUBLINGS)
    image = _map(figure, ratio, medians, doublings, "median ratio", (-_DOUBLINGS, _DOUBLINGS))
    image.colorbar.set_ticks(np.linspace(-_DOUBLINGS, _DOUBLINGS, 5))
    image.colorbar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{2**value:.2g}"))
    ratio.set_title("(c) ISE over the constant gain's")
    ratio.set_ylabel("")
    for panel in (share, ratio):
        _mark(panel, data)
    share.legend(loc="upper left", bbox_to_anchor=(-0.2, -0.3), fontsize=points(6.5))

    cubic4, count = named(job.observers, "cubic4", keys.Identity), settings.coefficients
    note = ";\n".join(
        f"{observer.label}, ℓ(y) = {vector(job.designs[observer.design].injection)}"
        for observer in job.observers.values()
        if _cubic(job.designs[observer.design].injection)
    )
    add_note(
        figure,
        f"{starts(job)} in (a). {note[:1].upper()}{note[1:]}.\n"
        f"(b), (c): identity form of order {cubic4.order}, gain {GAINS[cubic4.gain][1]}, "
        f"{count} by {count} pairs of coefficients of y³, each from {settings.points} by "
        f"{settings.points} initial states, but for that of the estimate.\n"
        f"In (c) black is {2**_DOUBLINGS:g} and more.",
    )
    return figure


def _map(
    figure: Figure, axes: Axes, rows: Any, values: Any, label: str, bounds: tuple[float, float]
) -> Any:
    """Squares of grey over the two coefficients, light where the injection does well."""
    first, second = (sorted(set(rows[name].tolist())) for name in ("x1", "x2"))
    table = np.empty((len(second), len(first)))
    for x1, x2, value in zip(rows["x1"], rows["x2"], values, strict=True):
        table[second.index(x2), first.index(x1)] = value
    good_is_high = bounds[0] == 0.0
    image = axes.pcolormesh(
        first, second, table, cmap="Greys_r" if good_is_high else "Greys",
        vmin=bounds[0], vmax=bounds[1], shading="nearest",
    )  # fmt: skip
    figure.colorbar(image, ax=axes, label=label, extend="neither" if good_is_high else "both")
    axes.set_aspect("equal")
    axes.grid(visible=False)
    axes.set_xlabel("coefficient of y³ for x₁")
    axes.set_ylabel("coefficient of y³ for x₂")
    return image


def _mark(axes: Axes, data: FigureData[keys.Job]) -> None:
    """Mark the observers of the figure on the square."""
    for name, observer in data.job.observers.items():
        cubic = _cubic(data.job.designs[observer.design].injection)
        if cubic:
            axes.plot(
                *cubic, linestyle="", marker=style_of(name).marker, markersize=mark(8),
                color=style_of(name).color, markeredgecolor="white", label=observer.label,
            )  # fmt: skip


def _cubic(injection: Any) -> tuple[float, ...]:
    """The coefficients of y^3 by component, or nothing if it has none."""
    terms = [(t["component"], float(t["coefficient"])) for t in injection if t["powers"] == [3]]
    return tuple(value for _, value in sorted(terms))


def draw_domain(data: FigureData[keys.Job]) -> Figure:
    """Phase plane, errors of the truncated series on the cycle, and radii by degree."""
    plant, study = data.plant, data.study
    settings = as_kind("study", data.job.study, keys.DomainStudy)
    figure, axes = mosaic(
        [["plane", "errors"], ["plane", "radii"]], 4.7, width_ratios=(1.1, 1.0),
        stacked={"plane": 3.8, "errors": 2.0, "radii": 2.0},
    )  # fmt: skip
    plane, errors, radii = axes["plane"], axes["errors"], axes["radii"]
    cycle, edge = _points(study, "point"), _points(study, "boundary")
    plane.plot(*_closed(cycle), **TRUTH.line(), label="limit cycle")
    plane.plot(
        plant["state"][:, 0], plant["state"][:, 1], **STYLES[0].line(), label="the run of Fig. 1"
    )
    plane.fill(*_closed(edge), color="0.9", zorder=0)
    plane.plot(*_closed(edge), **EDGE.line(), label="S converges inside, by the estimate")
    plane.plot(0, 0, color="0.3", marker="+")
    plane.set_aspect("equal")
    plane.set_xlabel("x₁")
    plane.set_ylabel("x₂")
    plane.set_title("(a) plane of states")
    plane.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13))

    for style, name, label in ((STYLES[0], "S", "S(x)"), (EDGE, "T", "T(z)")):
        errors.semilogy(
            *_by_level(study, name, "largest_error"), **style.points(), label=f"{label}, truncated"
        )
    decades(errors.yaxis)
    errors.set_xlabel("degree")
    errors.set_ylabel("largest error")
    errors.set_title("(b) error of the series on the cycle")
    errors.legend(loc="upper right")
    radii.plot(*_by_level(study, "S", "radius"), **STYLES[0].points())
    distance = data.metrics["cycle", "distance"]
    radii.axhline(distance, color="0.4", linewidth=thick(0.8), linestyle=":")
    radii.annotate(
        "distance of the cycle from the origin", (0.98, distance), (0, 3), ha="right",
        xycoords=("axes fraction", "data"), textcoords="offset points", fontsize=points(7),
        color="0.3",
    )  # fmt: skip
    radii.set_xlabel("degree")
    radii.set_ylabel("radius")
    radii.set_title("(c) estimated radius of convergence of S")
    add_note(
        figure,
        f"Series of S up to degree {settings.degree}; radius and boundary from its parts in "
        "the upper half of the degrees.\nThe true S on the cycle is the periodic solution of "
        f"ż = A z − ℓ(x₁(t)), ℓ(y) = {vector(data.job.designs[settings.design].injection)}.",
    )
    return figure


def _points(study: StudyTable, quantity: str) -> Any:
    rows = study.where(quantity=quantity)
    return np.stack([rows["x1"], rows["x2"]], axis=1)


def _closed(points: Any) -> Any:
    """The columns of a closed curve through the points."""
    return np.append(points, points[:1], axis=0).T
