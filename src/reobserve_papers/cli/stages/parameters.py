"""Stage parameters: a parameter file with the overrides of a user, checked and written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from reobserve.core.files import write_text
from reobserve_papers.parameters.parameter_checks import check_parameters
from reobserve_papers.parameters.parameters import Parameters, default_seed


def run(
    project: Path, paper: str, overrides: dict[str, Any], seed: int | None, output: Path
) -> None:
    """Resolve, build every plant and observer once to check them, and write."""
    root = default_seed(project) if seed is None else seed
    parameters = Parameters.load(project, paper, overrides, root)
    check_parameters(parameters)
    write_text(output, parameters.text())
