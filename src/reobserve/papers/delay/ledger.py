"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import located
from reobserve.grid import stride
from reobserve.ledger import Ledger
from reobserve.ledger_check import check_scenarios
from reobserve.papers.delay import observe, plant
from reobserve.papers.delay.study import check_study


def check(ledger: Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger."""
    settings = ledger.section("plant")
    check_scenarios(ledger, plant.build)
    for name, observer in ledger.section("observers").items():
        with located(f"{ledger.paper}.observers.{name}"):
            observe.build({"plant": settings, "observer": observer})
            stride(settings, observer["step_size"])
    for name, study in ledger.section("studies").items():
        with located(f"{ledger.paper}.studies.{name}"):
            check_study(study)
