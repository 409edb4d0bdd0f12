"""Stage verdicts: how the claims of each paper fared, for readers; fails if a claim is broken."""

from __future__ import annotations

from pathlib import Path

from reobserve.errors import ReobserveError
from reobserve.evidence.claims.gallery import gallery, table
from reobserve.evidence.claims.table import HEADER, KINDS
from reobserve.evidence.claims.verdicts import BROKEN
from reobserve.ledger.ledger import Ledger
from reobserve.plain_data.files import read_table, write_text


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
