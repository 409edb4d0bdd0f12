"""Stage plot: error responses, and studies of orders, injections and convergence."""

from __future__ import annotations

from reobserve_papers.papers.lie import plot_errors, plot_studies

LAYOUTS = {
    "errors": plot_errors.responses,
    "forms": plot_errors.forms,
    "orders": plot_studies.draw_orders,
    "ensemble": plot_studies.draw_ensemble,
    "injections": plot_studies.draw_injections,
    "domain": plot_studies.draw_domain,
}
