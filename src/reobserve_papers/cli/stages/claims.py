"""Stage claims: the verdicts on all claims of the papers that are built, in one table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from reobserve.core.errors import InputError, nearest, shown
from reobserve.core.files import write_table
from reobserve_papers.claims.checks import THEORY
from reobserve_papers.claims.registry import amiss, read_registry
from reobserve_papers.claims.robustness_file import read_robustness
from reobserve_papers.claims.table import HEADER, broken_row, row
from reobserve_papers.metrics.metrics import lookup, read_metrics
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.names import stored_parameters
from reobserve_papers.parameters.parameters import Parameters


def run(paper: Sequence[str], results: Path, output: Path, project: Path) -> None:
    """Decide and write: from the numbers of each figure, the theory's and the robustness.

    A claim or a registry that is wrong gets a row that says what is wrong with it.

    Raises
    ------
    InputError
        If there is no paper of a name.
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
    claims = read_registry(project, parameters).claims
    named = [*parameters.tree["figures"], *([THEORY] if THEORY in parameters.tree else [])]
    numbers = {name: lookup(read_metrics(folder / f"{name}.metrics.csv")) for name in named}
    robustness = read_robustness(folder / "robustness.json", paper)
    rows = [row(claim, parameters, numbers, robustness.get(claim.name)) for claim in claims]
    problem = "; ".join(amiss(claims))
    return [*rows, *([broken_row(paper, problem)] if problem else [])]
