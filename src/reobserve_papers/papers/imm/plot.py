"""Stage plot: probabilities of the modes over time, and the studies of them."""

from __future__ import annotations

from reobserve_papers.papers.imm import plot_probability, plot_studies

LAYOUTS = {
    "normal": plot_probability.draw,
    "leakage": plot_probability.draw,
    "switching": plot_probability.draw_switching,
    "neighbourhood": plot_studies.draw_neighbourhood,
    "changes": plot_studies.draw_changes,
    "causes": plot_studies.draw_causes,
}
