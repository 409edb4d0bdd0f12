"""Stage plant: a scenario's plant, from the ledger to Parquet."""

from __future__ import annotations

from pathlib import Path

from reobserve.replication.parameters.ledger import Ledger
from reobserve.replication.steps import compute, signed


def run(ledger_file: Path, scenario: str, output: Path) -> None:
    """Simulate and write; nothing is written if the plant cannot be simulated."""
    ledger = Ledger.read(ledger_file)
    settings = ledger.settings("plant", scenario)
    series = compute(ledger.paper, "plant", scenario, settings)
    signed(series, ledger, "plant", scenario, settings).write(output)
