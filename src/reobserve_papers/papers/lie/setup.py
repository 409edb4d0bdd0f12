"""Normal form and observers from their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from reobserve.core.errors import InputError, located
from reobserve.core.matrices import FloatArray, as_vector
from reobserve.core.validation import parse
from reobserve.observers.normal_form import (
    IdentityObserver,
    NormalFormObserver,
    TransformedObserver,
)
from reobserve.polynomials.maps import PolynomialMap
from reobserve.synthesis.normal_form.problem import NormalFormProblem
from reobserve.synthesis.normal_form.transform import NormalForm, normal_form
from reobserve_papers.papers.lie import keys
from reobserve_papers.papers.lie.plant import build_system

Array = FloatArray


def build_problem(
    plant: keys.Plant,
    design: keys.InjectionDesign,
    *,
    degree: int | None = None,
    exact: bool = False,
) -> NormalFormProblem:
    """The normal-form problem of a design, of its own degree or another."""
    system = build_system(plant, exact=exact)
    terms = design.injection
    injection = PolynomialMap.from_terms(
        "injection", terms, system.states, system.outputs, exact=exact
    )
    return NormalFormProblem(system, injection, degree or design.degree)


@dataclass(frozen=True, eq=False)
class StoredSeries:
    """A stored design: monomials, and their coefficients, one row per component."""

    monomials: Array
    S: Array
    T: Array
    gain: Array


def stored_form(
    plant: keys.Plant, design: keys.InjectionDesign, series: Mapping[str, Any]
) -> NormalForm:
    """The normal form whose series the stage design has computed."""
    stored, problem = parse(StoredSeries, series, "design"), build_problem(plant, design)
    basis = problem.basis
    if not np.array_equal(stored.monomials, basis.exponents):
        raise InputError("design.monomials", f"are not those up to degree {basis.degree}")
    S, T = (PolynomialMap(basis, rows) for rows in (stored.S, stored.T))
    gain = PolynomialMap(S.jacobian().basis, stored.gain)
    states = problem.system.states
    for name, rows in (("S", states), ("T", states), ("gain", states * states)):
        count = len(getattr(stored, name))
        if count != rows:
            raise InputError(f"design.{name}", f"has {count} rows, must have {rows}")
    return NormalForm(problem, None, S, T, gain)


def forms(job: keys.Job, own: str, design: Mapping[str, Any]) -> dict[str, NormalForm]:
    """The normal forms of a study by design: its own is read, those of observers are solved."""
    solved = {own: stored_form(job.plant, job.designs[own], design)}
    for name, body in job.designs.items():
        if name != own:
            with located(f"designs.{name}"):
                problem = build_problem(job.plant, body)
                solved[name] = normal_form(
                    problem.system, problem.degree, injection=problem.injection
                )
    return solved


def build_observer(observer: keys.Observer, form: NormalForm) -> NormalFormObserver:
    """The observer of an entry of ``observers``."""
    as_vector("initial_estimate", observer.initial_estimate, form.problem.system.states)
    if isinstance(observer, keys.Identity):
        return IdentityObserver(
            form, order=observer.order, gain=observer.gain, sampling_period=observer.sampling_period
        )
    return TransformedObserver(form, order=observer.order, sampling_period=observer.sampling_period)
