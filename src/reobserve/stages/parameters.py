"""Stage parameters: a parameter file with the overrides of a user, checked and written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from reobserve.ledger.check import check_ledger
from reobserve.ledger.ledger import Ledger
from reobserve.plain_data.files import write_text


def run(project: Path, paper: str, overrides: dict[str, Any], seed: int, output: Path) -> None:
    """Resolve, build every plant and observer once to check them, and write."""
    ledger = Ledger.load(project, paper, overrides, seed)
    check_ledger(ledger)
    write_text(output, ledger.text())
