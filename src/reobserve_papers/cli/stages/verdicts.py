"""Stage verdicts: how the claims of each paper fared, with a failure if a claim is broken."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reobserve.core.errors import ReobserveError
from reobserve.core.files import read_table, write_text
from reobserve_papers.claims.alternatives import read_alternatives
from reobserve_papers.claims.table import HEADER, KINDS
from reobserve_papers.claims.verdict_table import table
from reobserve_papers.claims.verdicts import BROKEN


def run(claims_file: Path, alternatives_files: Sequence[Path], output: Path) -> None:
    """Count and write a table with titles and their reasons, in Markdown."""
    rows = read_table(claims_file, HEADER, KINDS, ("paper", "claim"))
    broken = [row["problem"] for row in rows if row["verdict"] == BROKEN]
    if broken:
        raise ReobserveError("; ".join(broken))
    titles = {path.parent.name: read_alternatives(path)[0] for path in alternatives_files}
    write_text(output, table(rows, titles))
