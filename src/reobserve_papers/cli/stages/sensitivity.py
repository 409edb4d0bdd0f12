"""Stage sensitivity: plots of the samples that decided the claims of a paper."""

from __future__ import annotations

from pathlib import Path

from reobserve_papers.claims.plot import sensitivity_bars, specification_curves
from reobserve_papers.claims.registry import read_registry
from reobserve_papers.claims.robustness_file import read_robustness
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.plotting.fitting import fix_layout
from reobserve_papers.plotting.formats import save

_PLOTS = {"specification": specification_curves, "sensitivity": sensitivity_bars}


def run(parameter_file: Path, robustness_file: Path, outputs: list[Path], project: Path) -> None:
    """Draw and save. The name of an output, without its suffix, says which plot it is."""
    parameters = Parameters.read(parameter_file)
    claims = read_registry(project, parameters).claims
    found = read_robustness(robustness_file, parameters.paper)
    for name, draw in _PLOTS.items():
        plot = draw(claims, found)
        fix_layout(plot)
        for output in outputs:
            if output.stem == name:
                save(plot, output)
