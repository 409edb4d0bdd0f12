"""Stage plot: error responses, and what the studies say of orders, ensembles and convergence."""

from __future__ import annotations

from reobserve.drawing.layouts import by_layout
from reobserve.papers.lie import keys, plot_domain, plot_ensemble, plot_errors, plot_orders

LAYOUTS = {
    "errors": plot_errors.responses,
    "forms": plot_errors.forms,
    "orders": plot_orders.draw,
    "ensemble": plot_ensemble.draw,
    "domain": plot_domain.draw,
}

draw = by_layout(keys.Ledger, LAYOUTS, ("orders", "ensemble", "domain"))
