"""Stage observe: one observer on one scenario's record, from Parquet to Parquet."""

from __future__ import annotations

from pathlib import Path

from reobserve.cli.stages.records import read_record
from reobserve.replication.parameters.ledger import Ledger
from reobserve.replication.steps import compute, named_design, signed


def run(
    ledger_file: Path, plant_file: Path, observer: str, design_file: Path | None, output: Path
) -> None:
    """Observe and write; nothing is written if the observer cannot run or diverges."""
    ledger = Ledger.read(ledger_file)
    settings = ledger.settings("observe", observer)
    design = named_design(ledger, settings["observer"], design_file)
    plant = read_record(plant_file, ledger)
    series = compute(ledger.paper, "observe", observer, settings, plant, *design)
    signed(series, ledger, "observe", observer, settings).write(output)
