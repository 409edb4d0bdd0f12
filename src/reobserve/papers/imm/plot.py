"""Stage plot: probabilities of the modes over time, and what the studies say of them."""

from __future__ import annotations

from reobserve.papers.imm import (
    plot_causes,
    plot_changes,
    plot_closeness,
    plot_neighbourhood,
    plot_probability,
)

LAYOUTS = {
    "normal": plot_probability.draw,
    "leakage": plot_probability.draw,
    "switching": plot_probability.draw_switching,
    "neighbourhood": plot_neighbourhood.draw,
    "changes": plot_changes.draw,
    "closeness": plot_closeness.draw,
    "causes": plot_causes.draw,
}
