"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.ledger.check import building, check_figures, check_scenarios
from reobserve.papers.eso import keys, plant
from reobserve.papers.eso.scoring import check_rules
from reobserve.papers.eso.setup import augmented


def check(ledger: keys.Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger.

    Designs are not computed: whether a solver finds one shows in their stage.
    """
    check_scenarios(ledger, plant.build)
    augmented(ledger.plant, 1.0)  # what can be wrong with the plant is so with any filter
    for name, design in ledger.designs.items():
        with building(f"designs.{name}"):
            augmented(ledger.plant, design.filter_rate)
    check_figures(ledger, keys.DesignsFigure, {})
    check_rules(ledger.metrics, ledger.plant)
