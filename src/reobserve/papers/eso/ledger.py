"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import InputError, located
from reobserve.ledger import Ledger
from reobserve.ledger_check import check_scenarios
from reobserve.papers.eso import plant
from reobserve.papers.eso.design import check_kind
from reobserve.papers.eso.observe import check_algorithm
from reobserve.papers.eso.scoring import check_rules
from reobserve.papers.eso.setup import augmented
from reobserve.papers.eso.study import check_study


def check(ledger: Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger.

    Designs are not computed: whether a solver finds one shows in their stage.
    """
    settings = ledger.section("plant")
    check_scenarios(ledger, plant.build)
    designs = ledger.section("designs")
    with located(ledger.paper):
        augmented(settings, 1.0)  # what can be wrong with the plant is so with any filter
    for name, body in designs.items():
        with located(f"{ledger.paper}.designs.{name}"):
            check_kind(body["kind"])
            augmented(settings, body["filter_rate"])
    for name, body in ledger.section("observers").items():
        with located(f"{ledger.paper}.observers.{name}"):
            check_algorithm(body)
            if "design" not in body:
                raise InputError("design", f"is missing, must be one of {', '.join(designs)}")
    with located(ledger.paper):
        check_rules(ledger.section("metrics"), settings)
    for name, study in ledger.section("studies").items():
        with located(f"{ledger.paper}.studies.{name}"):
            check_study(study)
