"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import located
from reobserve.grid import noise_hold
from reobserve.ledger_check import check_scenarios
from reobserve.papers.ilo import keys, plant
from reobserve.papers.ilo.setup import build_observer


def check(ledger: keys.Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger."""
    noise_hold(ledger.plant)
    check_scenarios(ledger, plant.build)
    for name, observer in ledger.observers.items():
        with located(f"observers.{name}"):
            build_observer(ledger.plant, observer)
