"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import located
from reobserve.ledger import Ledger
from reobserve.ledger_check import check_scenarios
from reobserve.papers.imm import observe, plant, search
from reobserve.papers.imm.scoring import check_rules
from reobserve.papers.imm.study import check_study

PERIOD = 1e-3  # [s]: any one shows whether a bank can be built


def check(ledger: Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger."""
    settings = ledger.section("plant")
    check_scenarios(ledger, plant.build)
    for name, observer in ledger.section("observers").items():
        with located(f"{ledger.paper}.observers.{name}"):
            observe.build({"plant": settings, "observer": observer}, PERIOD)
    with located(ledger.paper):
        check_rules(ledger.section("metrics"))
    for name, study in ledger.section("studies").items():
        with located(f"{ledger.paper}.studies.{name}"):
            check_study(study)
    for name, body in ledger.section("searches").items():
        with located(f"{ledger.paper}.searches.{name}"):
            search.check(body)
