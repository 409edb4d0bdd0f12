"""Stage table: a table that is a product of its own, from a design to CSV."""

from __future__ import annotations

from pathlib import Path

from reobserve.errors import located
from reobserve.ledger.ledger import Ledger
from reobserve.pipeline.common import named_design, paper_module
from reobserve.plain_data.files import write_table


def run(ledger_file: Path, table: str, design_file: Path, output: Path) -> None:
    """Fill and write; nothing is written if the table cannot be filled."""
    ledger = Ledger.read(ledger_file)
    settings = ledger.settings("table", table)
    design = named_design(ledger, settings["table"], design_file)
    module = paper_module(ledger.paper, "table")
    with located(f"{ledger.paper}.tables.{table}"):
        rows = module.rows(settings, *design)
    write_table(output, rows, module.HEADER)
