"""Stage design: gains and series that several jobs share, from the parameter file to JSON."""

from __future__ import annotations

import json
from pathlib import Path

from reobserve.core.files import write_text
from reobserve.core.seals import sealed
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.compute import compute_design, provenance


def run(parameter_file: Path, design: str, output: Path) -> None:
    """Compute and write. Nothing is written if the design cannot be computed."""
    parameters = Parameters.read(parameter_file)
    stored = {
        "design": compute_design(parameters, design),
        "provenance": provenance(
            parameters, "design", design, parameters.settings("design", design)
        ),
    }
    write_text(output, json.dumps(sealed(stored), indent=1, ensure_ascii=False) + "\n")
