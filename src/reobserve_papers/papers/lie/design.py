"""Stage design: the series of a normal form, shared by all observers of any order."""

from __future__ import annotations

from typing import Any

from reobserve.synthesis.normal_form.transform import normal_form
from reobserve_papers.papers.lie import keys
from reobserve_papers.papers.lie.setup import build_problem


def compute(job: keys.Job) -> dict[str, Any]:
    """Coefficients of S, T and the gain, one row per component.

    The order of the monomials is that of `reobserve.polynomials.monomials`.
    """
    problem = build_problem(job.plant, job.design)
    form = normal_form(problem.system, problem.degree, injection=problem.injection)
    series = {"S": form.S, "T": form.T, "gain": form.gain}
    return {
        "monomials": form.S.basis.exponents.tolist(),
        **{name: part.coefficients.tolist() for name, part in series.items()},
    }
