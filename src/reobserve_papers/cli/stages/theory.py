"""Stage theory: a table of the numbers of a paper's theory, from its parameters and designs."""

from __future__ import annotations

from pathlib import Path

from reobserve.core.errors import InputError
from reobserve_papers.metrics.metrics import write_metrics
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.compute import compute, read_design


def run(parameter_file: Path, design_files: list[Path], output: Path) -> None:
    """Compute and write. The designs come in the order of the parameter file."""
    parameters = Parameters.read(parameter_file)
    settings = parameters.settings("theory")
    names = list(settings["designs"])
    if len(design_files) != len(names):
        wanted = ", ".join(names) or "no design"
        given = len(design_files)
        raise InputError("--design-files", f"{given} given, must be one each for {wanted}")
    designs = {
        name: read_design(path, (parameters.paper, name))
        for name, path in zip(names, design_files, strict=True)
    }
    found = compute(parameters, "theory", "", settings, designs)
    write_metrics(output, found)
