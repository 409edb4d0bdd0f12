"""Stage verdicts: how the claims of each paper fared, for readers; fails if a claim is broken."""

from __future__ import annotations

from pathlib import Path

from reobserve.claims.gallery import gallery, table
from reobserve.claims.table import HEADER, KINDS
from reobserve.claims.verdicts import BROKEN
from reobserve.errors import ReobserveError
from reobserve.files import read_table, write_text
from reobserve.ledger import Ledger


def run(claims_file: Path, output: Path, project: Path) -> None:
    """Count and write, in Markdown: a table, and the papers' figures with their verdicts.

    Raises
    ------
    ReobserveError
        If claims are broken: a sentence for each, and no table.
    """
    rows = read_table(claims_file, HEADER, KINDS, ("paper", "claim"))
    broken = [row["problem"] for row in rows if row["verdict"] == BROKEN]
    if broken:
        raise ReobserveError("; ".join(broken))
    papers = dict.fromkeys(row["paper"] for row in rows)
    ledgers = [Ledger.load(project, paper) for paper in papers]
    write_text(output, f"{table(rows)}\n{gallery(rows, ledgers)}")
