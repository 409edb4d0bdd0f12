"""Check the ledger before anything runs."""

from reobserve.ledger import Ledger
from reobserve.stages.common import compute_design


def check(ledger: Ledger) -> None:
    for name in ledger.section("designs"):
        compute_design(ledger, name)
