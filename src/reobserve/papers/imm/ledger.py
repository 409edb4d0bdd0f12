"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import located
from reobserve.ledger import Ledger
from reobserve.ledger_check import check_scenarios
from reobserve.papers.imm import observe, plant, search
from reobserve.papers.imm.scoring import check_quoted, check_rules
from reobserve.papers.imm.setup import start
from reobserve.papers.imm.study import check_study

PERIOD = 1e-3  # [s]: any one shows whether a bank can be built


def check(ledger: Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger."""
    settings = ledger.section("plant")
    check_scenarios(ledger, plant.build)
    for name, observer in ledger.section("observers").items():
        with located(f"{ledger.paper}.observers.{name}"):
            bank = observe.build({"plant": settings, "observer": observer}, PERIOD)
            start(bank, observer)
            check_quoted(observer)
    with located(ledger.paper):
        check_rules(ledger.section("metrics"), settings["horizon"])
    for name in ledger.section("studies"):
        with located(f"{ledger.paper}.studies.{name}"):
            check_study(ledger.settings("study", name))
    for name, body in ledger.section("searches").items():
        with located(f"{ledger.paper}.searches.{name}"):
            search.check(body)
