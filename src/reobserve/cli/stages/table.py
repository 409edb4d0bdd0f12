"""Stage table: a table that is a product of its own, from a design to CSV."""

from __future__ import annotations

from pathlib import Path

from reobserve.core.files import write_table
from reobserve.replication.parameters.ledger import Ledger
from reobserve.replication.steps import compute, named_design, paper_module


def run(ledger_file: Path, table: str, design_file: Path, output: Path) -> None:
    """Fill and write; nothing is written if the table cannot be filled."""
    ledger = Ledger.read(ledger_file)
    settings = ledger.settings("table", table)
    design = named_design(ledger, settings["table"], design_file)
    rows = compute(ledger.paper, "table", table, settings, *design)
    write_table(output, rows, paper_module(ledger.paper, "table").HEADER)
