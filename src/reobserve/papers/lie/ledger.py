"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import InputError, located
from reobserve.grid import stride
from reobserve.ledger import Ledger
from reobserve.ledger_check import check_scenarios
from reobserve.papers.lie import plant
from reobserve.papers.lie.setup import build_observer, build_problem
from reobserve.papers.lie.study import check_study
from reobserve.synthesis.normal_form.design import NormalForm, normal_form


def check(ledger: Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger."""
    settings = ledger.section("plant")
    check_scenarios(ledger, plant.build)
    forms: dict[str, NormalForm] = {}
    for name, design in ledger.section("designs").items():
        with located(f"{ledger.paper}.designs.{name}"):
            problem = build_problem(settings, design)
            forms[name] = normal_form(problem.system, problem.degree, injection=problem.injection)
    for name, observer in ledger.section("observers").items():
        with located(f"{ledger.paper}.observers.{name}"):
            if "design" not in observer:
                raise InputError("design", f"is missing, must be one of {', '.join(forms)}")
            stride(settings, build_observer(observer, forms[observer["design"]]).step_size)
    for name, study in ledger.section("studies").items():
        with located(f"{ledger.paper}.studies.{name}"):
            check_study(study, forms[study["design"]])
