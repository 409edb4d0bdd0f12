"""Stage claims: the verdicts on all claims of the papers that are built, in one table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError
from reobserve.core.files import write_table
from reobserve_papers.claims.claims_table import HEADER, broken_row, row
from reobserve_papers.claims.registry import amiss
from reobserve_papers.cli.stages.alternatives import decider_of
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.chain import project_of, result


def run(parameter_file: Sequence[Path]) -> None:
    """Decide and write: from the numbers of each figure, the theory's and the robustness.

    A claim or a registry that is wrong gets a row that says what is wrong with it.
    """
    rows: list[dict[str, Any]] = []
    papers = {path.resolve(): (path, Parameters.read(path)) for path in parameter_file}
    projects = {project_of(*pair) for pair in papers.values()} or {Path()}
    project = projects.pop()
    if projects:
        raise InputError(str(parameter_file[-1]), f"must be of the project {project}, too")
    if not papers and [*project.glob("results/*/robustness.json")]:
        raise InputError("parameter_file", "must be one or more of results/*/parameters.json")
    for _, parameters in papers.values():
        try:
            rows += _rows(project, parameters)
        except InputError as error:
            rows.append(broken_row(parameters.paper, str(error)))
    write_table(project / result("", "claims"), rows, HEADER, seal=True)


def _rows(project: Path, parameters: Parameters) -> list[dict[str, Any]]:
    paper = parameters.paper
    decider = decider_of(project, parameters)
    claims = decider.registry.claims
    rows = [
        row(claim, decider, decider.numbers, decider.samples.get(claim.name)) for claim in claims
    ]
    problem = "; ".join(amiss(claims))
    return [*rows, *([broken_row(paper, problem)] if problem else [])]
