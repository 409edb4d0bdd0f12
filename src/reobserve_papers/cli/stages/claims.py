"""Stage claims: the verdicts on all claims of the papers that are built, in one table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.files import write_table
from reobserve_papers.claims.alternatives import read_alternatives
from reobserve_papers.claims.registry import amiss, read_registry
from reobserve_papers.claims.table import HEADER, broken_row, row
from reobserve_papers.cli.stages.alternatives import decider_of
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.names import stored_parameters
from reobserve_papers.parameters.parameters import Parameters


def run(paper: Sequence[str], results: Path, output: Path, project: Path) -> None:
    """Decide and write: from the numbers of each figure, the theory's and the robustness.

    A claim or a registry that is wrong gets a row that says what is wrong with it.
    """
    rows: list[dict[str, Any]] = []
    known = known_papers(project)
    for name in paper:
        if name not in known:
            raise InputError("paper", f"there is no {shown(name)}{nearest(name, known)}")
        try:
            rows += _rows(project, results, name)
        except InputError as error:
            rows.append(broken_row(name, str(error)))
    write_table(output, rows, HEADER, seal=True)


def _rows(project: Path, results: Path, paper: str) -> list[dict[str, Any]]:
    folder = results / paper
    parameters = Parameters.read(folder / Path(stored_parameters(paper)).name)
    registry = read_registry(project, parameters)
    decider = decider_of(parameters, registry, folder / "robustness.json")
    _, changes = read_alternatives(folder / "alternatives.csv")
    rows = [
        row(
            claim, decider, decider.numbers, decider.samples.get(claim.name),
            "; ".join(one["alternative"] for one in changes if one["claim"] == claim.name
                      and one["other"] != one["verdict"]),
        )
        for claim in registry.claims
    ]  # fmt: skip
    problem = "; ".join(amiss(registry.claims))
    return [*rows, *([broken_row(paper, problem)] if problem else [])]
