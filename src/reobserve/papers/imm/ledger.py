"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import located
from reobserve.ledger.check import building, check_figures, check_scenarios
from reobserve.ledger.types import Job
from reobserve.papers.imm import keys, observe, plant, search, theory
from reobserve.papers.imm.scoring import check_rules
from reobserve.papers.imm.setup import start
from reobserve.papers.imm.study import check_study

PERIOD = 1e-3  # [s]: any one shows whether a bank can be built


def check(ledger: keys.Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger."""
    check_scenarios(ledger, plant.build)
    for name, observer in ledger.observers.items():
        with building(f"observers.{name}"):
            start(observe.build(Job(ledger.plant, observer=observer), PERIOD), observer)
    check_rules(ledger.metrics, ledger.plant.horizon)
    for name, study in ledger.studies.items():
        with building(f"studies.{name}"):
            scenario = ledger.scenarios[study.scenario]
            check_study(Job(ledger.plant, scenario=scenario, study=study))
    for name, body in ledger.searches.items():
        with located(f"searches.{name}"):
            search.check(body)
    check_figures(ledger, keys.StudyFigure, {})
    with located("theory"):
        theory.check(ledger.theory, ledger.observers)
