"""Check what the types of the ledger's keys cannot: where gains come from, and that there are."""

from math import isfinite

from reobserve.papers.toy import design, keys

from reobserve.errors import InputError
from reobserve.ledger.types import Job


def check(ledger: keys.Ledger) -> None:
    for name, observer in ledger.observers.items():
        if (observer.gains is None) == (observer.design == ""):
            raise InputError(f"observers.{name}", "must have gains or a design, and not both")
    for name, stated in ledger.designs.items():
        gains = design.compute(Job(ledger.plant, design=stated))["gains"]
        if not all(map(isfinite, gains)):
            raise InputError(f"designs.{name}", "gives a number that is not finite")
