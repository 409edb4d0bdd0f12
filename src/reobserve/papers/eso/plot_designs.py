"""Lag and error of both faults against what is chosen in the design, for all kinds of design."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from reobserve.drawing.figures import STYLES, WIDTH, add_note, few_ticks
from reobserve.ledger.figure_data import FigureData

_KINDS = {
    "pi_feasible": "PI, feasible",
    "pi_least_norm": "PI, optimised",
    "pd_pi_least_norm": "PD/PI, optimised",
    "pd_pi_bounded": "PD/PI, least γ, bounded poles",
}
_PANELS = (
    ("actuator_lag", "noise_in_actuator_fault", "(a) actuator fault", "noise in it [V]"),
    ("sensor_lag", "noise_in_sensor_fault", "(b) sensor fault", "noise in it [rad/s]"),
)


def draw(data: FigureData) -> Figure:
    """One point a design: how late its estimates are, and what noise and disturbance do to them."""
    figure = Figure(figsize=(WIDTH, 5.6))
    panels = figure.subplots(2, 2)
    for column, (lag, noise, title, unit) in enumerate(_PANELS):
        disturbance = noise.replace("noise", "disturbance")
        for row, quantity in enumerate((noise, disturbance)):
            axes = panels[row, column]
            for style, (kind, label) in zip(STYLES, _KINDS.items(), strict=False):
                found = data.study.where(kind=kind)
                axes.loglog(
                    *(found.where(quantity=name)["value"] for name in (lag, quantity)),
                    linestyle="", marker=style.marker, color=style.color, markersize=4.5,
                    markerfacecolor="none" if kind == "pi_least_norm" else style.color,
                    markeredgewidth=1.1, label=label,
                )  # fmt: skip
            axes.set_ylabel(unit if row == 0 else unit.replace("noise", "disturbance"))
            few_ticks(axes, (0.01, 0.03, 0.1, 0.3, 1, 3))
        panels[0, column].set_title(title)
        panels[1, column].set_xlabel("lag of the estimate [s]")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=2)
    chosen = data.job.study
    add_note(
        figure,
        "Standard deviations at the ends of the holds, from a discrete Lyapunov equation. PI, "
        f"feasible: filter rates {_listed(chosen.filter_rates)}\nand decays "
        f"{_listed(chosen.decays)} per second. Optimised: γ over its floor "
        f"{_listed(chosen.factors)}; open squares and triangles fall together.\nLeast γ: poles "
        f"within {_listed(chosen.pole_bounds)} per second, matrices of norm up to "
        f"{chosen.radius:g}.",
    )
    return figure


def _listed(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)
