"""Stage sensitivity: pictures of the samples that decided the claims of a paper."""

from __future__ import annotations

from pathlib import Path

from reobserve.plotting.fitting import fix_layout
from reobserve.plotting.formats import save
from reobserve.replication.claims.plot import sensitivity_bars, specification_curves
from reobserve.replication.claims.registry import read_registry
from reobserve.replication.claims.robustness_file import read_robustness
from reobserve.replication.parameters.parameters import Parameters

_PICTURES = {"specification": specification_curves, "sensitivity": sensitivity_bars}


def run(parameter_file: Path, robustness_file: Path, outputs: list[Path], project: Path) -> None:
    """Draw and save; the name of an output, without its suffix, says which picture it is."""
    parameters = Parameters.read(parameter_file)
    claims = read_registry(project, parameters).claims
    found = read_robustness(robustness_file, parameters.paper)
    for name, draw in _PICTURES.items():
        picture = draw(claims, found)
        fix_layout(picture)
        for output in outputs:
            if output.stem == name:
                save(picture, output)
