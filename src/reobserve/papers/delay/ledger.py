"""Build everything the ledger states, once, and run nothing: errors show before a long build."""

from __future__ import annotations

from reobserve.errors import located
from reobserve.grid import stride
from reobserve.ledger_check import check_scenarios
from reobserve.ledger_types import Job
from reobserve.papers.delay import keys, observe, plant


def check(ledger: keys.Ledger) -> None:
    """Raise the `InputError` that a stage would raise, with the config key of the ledger."""
    check_scenarios(ledger, plant.build)
    for name, observer in ledger.observers.items():
        with located(f"observers.{name}"):
            observe.build(Job(ledger.plant, observer=observer))
            stride(ledger.plant, observer.step_size)
