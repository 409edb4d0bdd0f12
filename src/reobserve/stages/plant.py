"""Stage plant: a scenario's plant, from the ledger to Parquet."""

from __future__ import annotations

from pathlib import Path

from reobserve.errors import located
from reobserve.ledger.ledger import Ledger
from reobserve.pipeline.common import paper_module, signed


def run(ledger_file: Path, scenario: str, output: Path) -> None:
    """Simulate and write; nothing is written if the plant cannot be simulated."""
    ledger = Ledger.read(ledger_file)
    settings = ledger.settings("plant", scenario)
    with located(ledger.paper):
        series = paper_module(ledger.paper, "plant").simulate(settings)
    signed(series, ledger, "plant", scenario, settings).write(output)
