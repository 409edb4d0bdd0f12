"""Stage check: the ledgers of several papers, whole and in one process; nothing is written."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from reobserve.ledger.check import check_ledger
from reobserve.ledger.config import known_papers
from reobserve.ledger.ledger import Ledger
from reobserve.plain_data.json_data import check_plain


def run(project: Path, paper: Sequence[str], overrides: dict[str, Any]) -> None:
    """Read each ledger into its types and build what it states; `InputError` for the first fault.

    ``overrides`` are those of each paper by its name.
    """
    check_plain(overrides, "config")
    for name in paper or known_papers(project):
        check_ledger(Ledger.load(project, name, overrides.get(name)))
        print(f"{name}: its ledger can be built", file=sys.stderr)
