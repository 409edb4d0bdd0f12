"""Stage ledger: a paper's config with the user's overrides, checked and written for the others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from reobserve.files import write_text
from reobserve.ledger import Ledger
from reobserve.ledger_check import check_ledger


def run(project: Path, paper: str, overrides: dict[str, Any], seed: int, output: Path) -> None:
    """Resolve, build every plant and observer once to check them, and write."""
    ledger = Ledger.load(project, paper, overrides, seed)
    check_ledger(ledger)
    write_text(output, ledger.text())
