"""Stage plot: error responses, and what the studies say of orders, ensembles and convergence."""

from __future__ import annotations

from reobserve.papers.lie import (
    plot_domain,
    plot_ensemble,
    plot_errors,
    plot_injections,
    plot_orders,
)

LAYOUTS = {
    "errors": plot_errors.responses,
    "forms": plot_errors.forms,
    "orders": plot_orders.draw,
    "ensemble": plot_ensemble.draw,
    "injections": plot_injections.draw,
    "domain": plot_domain.draw,
}
