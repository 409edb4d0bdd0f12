"""Stage plot: states and delay over time, and the studies of gain, noise and tuning."""

from __future__ import annotations

from reobserve_papers.papers.delay import plot_comparison, plot_states, plot_tradeoff, plot_tuning

LAYOUTS = {
    "states": plot_states.draw,
    "comparison": plot_comparison.draw,
    "tradeoff": plot_tradeoff.draw,
    "tuning": plot_tuning.draw,
}
