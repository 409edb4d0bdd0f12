"""What the studies share: the columns of their table, and the normal forms they run on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from reobserve.errors import located
from reobserve.ledger.types import Job
from reobserve.papers.lie.setup import build_problem, stored_form
from reobserve.plain_data.files import GAP, NAME, SCORE, UNIT, WHOLE
from reobserve.synthesis.normal_form.design import NormalForm, normal_form


class Row(NamedTuple):
    """One number: of which form (or observer, or series), order or degree, and state."""

    form: str
    order: int
    x1: float | str
    x2: float | str
    quantity: str
    value: float
    unit: str


HEADER = Row._fields
KINDS = {
    "form": NAME, "order": WHOLE, "x1": GAP, "x2": GAP,
    "quantity": NAME, "value": SCORE, "unit": UNIT,
}  # fmt: skip


def summary(form: str, order: int, quantity: str, value: float, unit: str) -> Row:
    """A number that belongs to no single state."""
    return Row(form, order, "", "", quantity, float(value), unit)


def forms(job: Job, design: Mapping[str, Any]) -> dict[str, NormalForm]:
    """The normal forms of a study by design: its own as stored, those of its observers anew."""
    own = job.study.design
    found = {own: stored_form(job.plant, job.designs[own], design)}
    for name, body in job.designs.items():
        if name != own:
            with located(f"designs.{name}"):
                problem = build_problem(job.plant, body)
                found[name] = normal_form(
                    problem.system, problem.degree, injection=problem.injection
                )
    return found
