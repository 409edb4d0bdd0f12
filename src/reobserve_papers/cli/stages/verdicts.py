"""Stage verdicts: how the claims of each paper fared, with a failure if a claim is broken."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reobserve.core.errors import ReobserveError
from reobserve.core.files import read_table, write_text
from reobserve_papers.claims.claims_table import HEADER, KINDS
from reobserve_papers.claims.registry import read_claims
from reobserve_papers.claims.title import read_alternatives
from reobserve_papers.claims.verdict_rules import BROKEN
from reobserve_papers.claims.verdict_table import counts_table, dissent, titles_table
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.chain import project_of, result


def run(parameter_file: Sequence[Path]) -> None:
    """Write titles, counts of verdicts and dissent, in Markdown."""
    project = Path()
    for path in parameter_file[:1]:
        project = project_of(path, Parameters.read(path))
    rows = read_table(project / result("", "claims"), HEADER, KINDS, ("paper", "claim"))
    broken = [row["problem"] for row in rows if row["verdict"] == BROKEN]
    if broken:
        raise ReobserveError("; ".join(broken))
    papers = dict.fromkeys(row["paper"] for row in rows)
    titles = {name: read_alternatives(project / result(name, "alternatives"))[0] for name in papers}
    results = {name: read_claims(project, name).result for name in papers}
    said = [f"`{name}`: {dissent(title)}" for name, title in titles.items()]
    text = "\n".join([titles_table(titles, results), counts_table(rows), *said])
    write_text(project / result("", "verdicts"), text)
