"""Stage verdicts: how many claims of each paper got which verdict; fails if a claim is broken."""

from __future__ import annotations

from pathlib import Path

from reobserve.claims.table import HEADER
from reobserve.claims.verdicts import BROKEN, VERDICTS, count, replicated
from reobserve.errors import ReobserveError
from reobserve.files import read_table, write_text


def run(claims_file: Path, output: Path) -> None:
    """Count and write, as a table in Markdown.

    Raises
    ------
    ReobserveError
        If claims are broken: a sentence for each, and no table.
    """
    rows = read_table(claims_file, HEADER)
    broken = [row["problem"] for row in rows if row["verdict"] == BROKEN]
    if broken:
        raise ReobserveError("; ".join(broken))
    lines = [
        f"| paper | replication | claims | {' | '.join(VERDICTS)} |",
        f"|---|---|{'---:|' * (len(VERDICTS) + 1)}",
    ]
    for paper, found in count(rows).items():
        title = "[Re]" if replicated([row for row in rows if row["paper"] == paper]) else "[¬Re]"
        cells = [str(found[word]) for word in VERDICTS]
        total = sum(found.values())
        lines.append(f"| `{paper}` | {title} | {total} | {' | '.join(cells)} |")
    write_text(output, "\n".join(lines) + "\n")
