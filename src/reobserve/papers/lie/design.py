"""Stage design: the series of a normal form, shared by all observers of any order."""

from __future__ import annotations

from typing import Any

from reobserve.papers.lie import keys
from reobserve.papers.lie.setup import build_problem
from reobserve.polynomials.maps import PolynomialMap
from reobserve.replication.parameters.job import Settings, read_job
from reobserve.synthesis.normal_form.design import normal_form


def compute(settings: Settings) -> dict[str, Any]:
    """Coefficients of S, T and the gain, one row a component, and the smallest divisor.

    The order of the monomials is that of `reobserve.polynomials.monomials`.

    Raises
    ------
    InputError
        If the injection cannot be used: unstable, resonant, or of the wrong size.
    """
    job = read_job(keys.Ledger, settings)
    problem = build_problem(job.plant, job.design)
    form = normal_form(problem.system, problem.degree, injection=problem.injection)
    found: dict[str, Any] = {
        "monomials": form.S.basis.exponents.tolist(),
        **{name: _rows(getattr(form, name)) for name in ("S", "T", "gain")},
    }
    if form.resonance is not None:
        found["resonance"] = {
            "distance": form.resonance.distance,
            "powers": list(form.resonance.powers),
            "eigenvalue": [form.resonance.eigenvalue.real, form.resonance.eigenvalue.imag],
            "poincare": form.resonance.poincare,
        }
    return found


def _rows(series: PolynomialMap) -> list[list[float]]:
    rows: list[list[float]] = series.coefficients.tolist()
    return rows
