"""Stage table: the coefficients of T(z) that the paper prints, beside the exact ones."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from fractions import Fraction
from typing import Any

from reobserve.core.errors import InputError, located
from reobserve.core.files import GAP, NAME, NUMBER
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.direct_s import solve_s
from reobserve.synthesis.normal_form.direct_t import solve_t
from reobserve.synthesis.normal_form.solver import solver_for
from reobserve_papers.papers.lie import keys
from reobserve_papers.papers.lie.setup import build_problem, stored_form

HEADER = ("component", "term", "exact", "decimal", "computed", "printed", "agrees")
KINDS = {
    "component": NAME, "term": NAME, "decimal": NUMBER, "computed": NUMBER, "printed": GAP,
}  # fmt: skip


def rows(job: keys.Job, design: Mapping[str, Any]) -> list[dict[str, Any]]:
    """One row per term of T and of its inverse S, up to the degree that the paper prints.

    Thomas, Kwatny & Chang, Section 5, T(z).

    ``exact`` is the rational coefficient, ``decimal`` its value to nine digits, ``computed`` the
    floating-point one that the observers use. ``agrees`` says whether the exact value rounds to
    the printed digits; it is empty for what the paper does not print.
    """
    degree = job.table.degree
    with located(f"designs.{job.table.design}"):
        problem = build_problem(job.plant, job.design, degree=degree, exact=True)
    form = stored_form(job.plant, job.design, design)
    computed = {"S": form.S, "T": form.T}
    if degree > form.problem.degree:
        raise InputError("degree", f"{degree} is beyond that of the design, {form.problem.degree}")
    solver = solver_for(problem)
    printed = {
        (term["component"], tuple(term["powers"])): term["text"] for term in job.table.printed
    }
    table = []
    for name, variable, solve in (("T", "z", solve_t), ("S", "x", solve_s)):
        series = PolynomialMap(problem.basis, solve(problem, solver))
        for component, powers, value in series.terms():
            place = problem.basis.place(powers)
            text = printed.get((component + 1, powers), "") if name == "T" else ""
            table.append(
                {
                    "component": f"{name}{component + 1}",
                    "term": _term(variable, powers),
                    "exact": str(value),
                    "decimal": f"{float(value):.9g}",
                    "computed": f"{computed[name].coefficients[component][place]:.9g}",
                    "printed": text,
                    "agrees": _agrees(value, text),
                }
            )
    return table


def _agrees(value: Fraction, text: str) -> str:
    """True if ``value`` is within half a unit of the last digit of ``text``."""
    if not text:
        return ""
    exponent = Decimal(text).as_tuple().exponent
    assert isinstance(exponent, int)
    return "yes" if abs(value - Fraction(text)) <= Fraction(10) ** exponent / 2 else "no"


def _term(variable: str, powers: tuple[int, ...]) -> str:
    factors = [
        f"{variable}{i + 1}" + (f"^{power}" if power > 1 else "")
        for i, power in enumerate(powers)
        if power
    ]
    return " ".join(factors)
