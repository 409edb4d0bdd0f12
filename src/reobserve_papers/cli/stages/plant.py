"""Stage plant: a scenario's plant, from the parameter file to Parquet."""

from __future__ import annotations

from pathlib import Path

from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.compute import compute, signed


def run(parameter_file: Path, scenario: str, output: Path) -> None:
    """Simulate and write. Nothing is written if the plant cannot be simulated."""
    parameters = Parameters.read(parameter_file)
    settings = parameters.settings("plant", scenario)
    series = compute(parameters, "plant", scenario, settings)
    signed(series, parameters, "plant", scenario, settings).write(output)
