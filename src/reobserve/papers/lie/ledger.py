"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import located
from reobserve.grid import stride
from reobserve.ledger_check import check_scenarios
from reobserve.papers.lie import keys, plant
from reobserve.papers.lie.setup import build_observer, build_problem
from reobserve.papers.lie.study import check_study
from reobserve.synthesis.normal_form.design import NormalForm, normal_form


def check(ledger: keys.Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger."""
    check_scenarios(ledger, plant.build)
    forms: dict[str, NormalForm] = {}
    for name, design in ledger.designs.items():
        with located(f"designs.{name}"):
            problem = build_problem(ledger.plant, design)
            forms[name] = normal_form(problem.system, problem.degree, injection=problem.injection)
    for name, observer in ledger.observers.items():
        with located(f"observers.{name}"):
            stride(ledger.plant, build_observer(observer, forms[observer.design]).step_size)
    for name, study in ledger.studies.items():
        with located(f"studies.{name}"):
            check_study(study, forms[study.design])
