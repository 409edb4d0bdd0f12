"""Stage plot: a fault with its estimates and their errors, and the map of the designs."""

from __future__ import annotations

from reobserve.drawing.layouts import by_layout
from reobserve.papers.eso import keys, plot_designs, plot_fault

LAYOUTS = {
    "actuator": plot_fault.draw,
    "sensor": plot_fault.draw,
    "designs": plot_designs.draw,
}

draw = by_layout(keys.Ledger, LAYOUTS, ("designs",))
