"""Check what the types of the ledger's keys cannot: an observer has gains, from one place."""

from reobserve.papers.toy import keys

from reobserve.errors import InputError


def check(ledger: keys.Ledger) -> None:
    for name, observer in ledger.observers.items():
        if (observer.gains is None) == (observer.design == ""):
            raise InputError(f"observers.{name}", "must have gains or a design, and not both")
