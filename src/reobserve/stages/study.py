"""Stage study: many runs over one record, from Parquet to a table."""

from __future__ import annotations

from pathlib import Path

from reobserve.errors import located
from reobserve.files import write_table
from reobserve.ledger import Ledger
from reobserve.series import Series
from reobserve.stages.common import named_design, paper_module


def run(
    ledger_file: Path, plant_file: Path, study: str, design_file: Path | None, output: Path
) -> None:
    """Run and write; nothing is written if one of the runs cannot be made."""
    ledger = Ledger.read(ledger_file)
    settings = ledger.settings("study", study)
    design = named_design(ledger, settings["study"], design_file)
    module = paper_module(ledger.paper, "study")
    with located(ledger.paper):
        rows = module.run(settings, Series.read(plant_file), *design)
    write_table(output, rows, module.HEADER)
