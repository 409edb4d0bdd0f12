"""Lags of the estimated faults and effects of noise and disturbance, for all kinds of design."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from reobserve_papers.papers.eso import keys
from reobserve_papers.parameters.figure_data import FigureData
from reobserve_papers.plotting.figures import STYLES, Style, add_note, blank, few_ticks
from reobserve_papers.plotting.style_sheet import mark, points, thick

_BLACK, _ORANGE, _BLUE, _, _GREEN = STYLES
_PURPLE = Style("#a66fc0", "-", 0.9, "D")  # solid and light, because it is the noisiest

# By the name of a design, as in the rows of the study.
KINDS = {
    "pi_feasible": (_BLACK, "PI, feasible: minimum norm"),
    "pi_positive": (replace(_BLACK, marker="^"), "PI, feasible: centre"),
    "pi_largest_margin": (replace(_BLACK, marker="x"), "PI, feasible: margin"),
    "pd_pi_minimum_norm": (_ORANGE, "PD/PI, minimum norm"),
    "pd_pi_minimum_gamma": (_PURPLE, "PD/PI, minimum γ"),
    "pi_minimum_norm": (_BLUE, "PI, minimum norm"),
    "pi_minimum_gamma": (_GREEN, "PI, minimum γ"),
}


def style_of(design: keys.Design) -> Style:
    """Style of an observer, by the kind of its design."""
    return KINDS[design.name][0]


_FAULTS = {"actuator": "V", "sensor": "rad/s"}
_FILLED = ("pi_feasible", "pd_pi_minimum_norm", "pd_pi_minimum_gamma")
_AROUND = ("pi_minimum_norm", "pi_minimum_gamma")  # larger, because they coincide with others


def draw(data: FigureData[keys.Job]) -> Figure:
    """Plot one point per design: lags of its estimates, and effects of noise or disturbance."""
    figure = blank(6.0)
    panels = figure.subplots(2, 2)
    for column, (fault, unit) in enumerate(_FAULTS.items()):
        for row, source in enumerate(("noise", "disturbance")):
            axes, letter = panels[row, column], "abcd"[2 * row + column]
            quantity = f"{source}_in_{fault}_fault"
            for kind, (style, label) in KINDS.items():
                rows = data.study.where(kind=kind)
                axes.loglog(
                    *(rows.where(quantity=name)["value"] for name in (f"{fault}_lag", quantity)),
                    linestyle="", marker=style.marker, color=style.color,
                    markersize=mark(7.5 if kind in _AROUND else 4.5),
                    markerfacecolor=style.color if kind in _FILLED else "none",
                    markeredgewidth=1.1 if kind in _AROUND else 0.8, label=label,
                )  # fmt: skip
            for at in _of_the_figures(data):
                rows = data.study.where(**at)
                axes.loglog(
                    *(rows.where(quantity=name)["value"] for name in (f"{fault}_lag", quantity)),
                    linestyle="", marker="o", color="0.2", markersize=mark(13),
                    markerfacecolor="none", markeredgewidth=0.8,
                )  # fmt: skip
            axes.margins(y=0.1)
            axes.set_title(f"({letter}) {fault} fault: effect of {source}")
            axes.set_ylabel(f"standard deviation [{unit}]")
            few_ticks(axes, (0.01, 0.03, 0.1, 0.3, 1, 3))
        _bound(panels[0, column], data.job.metrics.visible, unit)
        panels[1, column].set_xlabel("lag of the estimate [s]")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=3)
    add_note(figure, _note(data))
    return figure


def _bound(axes: Axes, level: float, unit: str) -> None:
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, level / 1.3), max(high, 2.0 * level))
    axes.axhline(level, color="0.45", linestyle=(0, (1, 1.5)), linewidth=thick(0.9))
    axes.annotate(
        f"visible in a figure: {level:g} {unit}", (0.02, level), (0, 2), textcoords="offset points",
        xycoords=axes.get_yaxis_transform(), va="bottom", fontsize=points(6.5), color="0.3",
    )  # fmt: skip


def _of_the_figures(data: FigureData[keys.Job]) -> Iterator[dict[str, Any]]:
    """Rows of the study that hold the designs of the figure's observers, if any."""
    for observer in data.job.observers.values():
        design = data.job.designs[observer.design]
        level = design.decay if isinstance(design, keys.Feasible) else design.level
        yield {"kind": design.name, "filter_rate": design.filter_rate, "level": level}


def _note(data: FigureData[keys.Job]) -> str:
    chosen, hold = data.job.study, data.job.plant.hold_period
    return (
        f"Standard deviations at the ends of the holds of {hold:g} s, from a discrete Lyapunov "
        "equation; lags without noise and disturbance.\n"
        f"PI by feasibility: filter rates {_listed(chosen.filter_rates)} and decays "
        f"{_listed(chosen.decays)} per second, three solutions of one inequality.\n"
        f"Minimum norm: γ over its lower bound {_listed(chosen.factors)}.\n"
        f"Minimum γ: poles within {_listed(chosen.pole_bounds)} per second, matrices within "
        f"{chosen.radius:g}, and with the first within {_listed(chosen.radii)}.\n"
        "Rings: the observers of Figs 2 to 5, and of the Remark."
    )


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)
