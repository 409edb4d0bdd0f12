"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import located
from reobserve.ledger import Ledger
from reobserve.ledger_check import check_scenarios
from reobserve.papers.ilo import plant
from reobserve.papers.ilo.setup import build_observer, held_noise, noise_deviation
from reobserve.random_streams import random_stream


def check(ledger: Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger."""
    settings = ledger.section("plant")
    with located(ledger.paper):
        noise_deviation(settings)
        held_noise(random_stream(0), settings, 1)
    check_scenarios(ledger, plant.build)
    for name, observer in ledger.section("observers").items():
        with located(f"{ledger.paper}.observers.{name}"):
            build_observer(settings, observer)
