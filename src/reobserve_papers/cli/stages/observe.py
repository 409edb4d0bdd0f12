"""Stage observe: one observer on one scenario's record, from Parquet to Parquet."""

from __future__ import annotations

from pathlib import Path

from reobserve_papers.cli.stages.records import read_record
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.compute import compute, named_design, signed


def run(
    parameter_file: Path, plant_file: Path, observer: str, design_file: Path | None, output: Path
) -> None:
    """Observe and write. Nothing is written if the observer cannot run or diverges."""
    parameters = Parameters.read(parameter_file)
    settings = parameters.settings("observe", observer)
    design = named_design(parameters, settings["observer"], design_file)
    plant = read_record(plant_file, parameters)
    series = compute(parameters, "observe", observer, settings, plant, *design)
    signed(series, parameters, "observe", observer, settings, plant).write(output)
