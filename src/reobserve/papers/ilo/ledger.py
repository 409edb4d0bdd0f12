"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import located
from reobserve.ledger.check import building, check_figures, check_scenarios, check_studies
from reobserve.ledger.types import named
from reobserve.papers.ilo import keys, plant
from reobserve.papers.ilo.setup import build_observer
from reobserve.papers.ilo.theory_runs import NEEDED
from reobserve.timeseries.grid import noise_hold

_MATCHED = {"continuous": keys.Continuous, "adaptive": keys.Adaptive}


def check(ledger: keys.Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger."""
    noise_hold(ledger.plant)
    check_scenarios(ledger, plant.build)
    for name, observer in ledger.observers.items():
        with building(f"observers.{name}"):
            build_observer(ledger.plant, observer)
    check_studies(ledger, {keys.Matching: _MATCHED})
    drawn = {**_MATCHED, "matched": keys.Adaptive}
    check_figures(ledger, keys.MatchingFigure, {"matching": drawn})
    with located("theory"):
        for name, kind in NEEDED.items():
            named(ledger.observers, name, kind)
