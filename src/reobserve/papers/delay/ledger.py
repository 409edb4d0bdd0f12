"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import InputError, located
from reobserve.ledger import Ledger
from reobserve.papers.delay import observe, plant
from reobserve.papers.delay.setup import stride
from reobserve.papers.delay.study import check_study


def check(ledger: Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger."""
    settings = ledger.section("plant")
    for name in ledger.section("scenarios"):
        try:
            with located(ledger.paper):
                plant.build(ledger.settings("plant", name))
        except InputError as error:
            here = f"{ledger.paper}.scenarios.{name}"
            key = error.parameter.replace(f"{ledger.paper}.scenario", here)
            raise InputError(key, error.problem) from None
    for name, observer in ledger.section("observers").items():
        with located(f"{ledger.paper}.observers.{name}"):
            observe.build({"plant": settings, "observer": observer})
            stride(settings, observer["step_size"])
    for name, study in ledger.section("studies").items():
        with located(f"{ledger.paper}.studies.{name}"):
            check_study(study)
