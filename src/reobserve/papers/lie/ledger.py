"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import InputError, located
from reobserve.ledger.check import building, check_figures, check_scenarios, check_studies
from reobserve.ledger.types import named
from reobserve.numerics.matrices import as_vector
from reobserve.papers.lie import keys, plant, theory
from reobserve.papers.lie.setup import build_observer, build_problem
from reobserve.papers.lie.study import check_study
from reobserve.synthesis.normal_form.design import NormalForm, normal_form
from reobserve.timeseries.grid import stride


def check(ledger: keys.Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger."""
    check_scenarios(ledger, plant.build)
    forms: dict[str, NormalForm] = {}
    for name, design in ledger.designs.items():
        with building(f"designs.{name}"):
            problem = build_problem(ledger.plant, design)
            forms[name] = normal_form(problem.system, problem.degree, injection=problem.injection)
    for name, observer in ledger.observers.items():
        with building(f"observers.{name}"):
            stride(ledger.plant, build_observer(observer, forms[observer.design]).sampling_period)
    for name, study in ledger.studies.items():
        with located(f"studies.{name}"):
            check_study(study, forms[study.design])
    of_orders, of_ensembles = {"injection": keys.Observer}, {"constant": keys.Observer}
    check_studies(ledger, {keys.OrdersStudy: of_orders, keys.EnsembleStudy: of_ensembles})
    check_figures(ledger, keys.StudyFigure, {})
    with located("theory"):
        for name in ("injection", "order4"):
            named(ledger.observers, name, keys.Observer)
        for name in ("linear", "nonlinear"):
            if name not in ledger.designs:
                raise InputError("designs", f"must have {name!r}")
        as_vector("initial_state", ledger.theory.initial_state, forms["linear"].S.variables)
        theory.conditions(ledger.plant, ledger.theory)
