"""Stage plot: a fault with its estimates and their errors, and the map of the designs."""

from __future__ import annotations

from reobserve.papers.eso import plot_designs, plot_fault

LAYOUTS = {
    "actuator": plot_fault.draw,
    "sensor": plot_fault.draw,
    "designs": plot_designs.draw,
}
