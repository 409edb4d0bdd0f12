"""Stage design: gains and series that several jobs share, from the ledger to JSON."""

from __future__ import annotations

import json
from pathlib import Path

from reobserve.core.files import write_text
from reobserve.replication.parameters.ledger import Ledger
from reobserve.replication.steps import compute_design, provenance


def run(ledger_file: Path, design: str, output: Path) -> None:
    """Compute and write; nothing is written if the design cannot be computed."""
    ledger = Ledger.read(ledger_file)
    stored = {
        "design": compute_design(ledger, design),
        "provenance": provenance(ledger, "design", design, ledger.settings("design", design)),
    }
    write_text(output, json.dumps(stored, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
