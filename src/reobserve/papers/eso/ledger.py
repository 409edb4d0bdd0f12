"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import located
from reobserve.ledger import Ledger
from reobserve.ledger_check import check_scenarios
from reobserve.papers.eso import plant
from reobserve.papers.eso.design import check_kind
from reobserve.papers.eso.scoring import check_rules
from reobserve.papers.eso.setup import augmented
from reobserve.papers.eso.study import check_study


def check(ledger: Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger.

    Designs are not computed: whether a solver finds one shows in their stage.
    """
    settings = ledger.section("plant")
    check_scenarios(ledger, plant.build)
    for name, body in ledger.section("designs").items():
        with located(f"{ledger.paper}.designs.{name}"):
            check_kind(body["kind"])
            augmented(settings, body["filter_rate"])
    with located(ledger.paper):
        check_rules(ledger.section("metrics"), settings["horizon"])
    for name, study in ledger.section("studies").items():
        with located(f"{ledger.paper}.studies.{name}"):
            check_study(study)
