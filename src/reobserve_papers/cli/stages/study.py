"""Stage study: many runs over one record, from Parquet to a table."""

from __future__ import annotations

from pathlib import Path

from reobserve.core.files import write_table
from reobserve_papers.cli.stages.records import read_record
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.compute import compute, named_design, paper_module


def run(
    parameter_file: Path, plant_file: Path, study: str, design_file: Path | None, output: Path
) -> None:
    """Run and write. Nothing is written if one of the runs cannot be made."""
    parameters = Parameters.read(parameter_file)
    settings = parameters.settings("study", study)
    design = named_design(parameters, settings["study"], design_file)
    plant = read_record(plant_file, parameters, settings["study"]["scenario"])
    rows = compute(parameters, "study", study, settings, plant, *design)
    write_table(output, rows, paper_module(parameters.package, "study_rows").HEADER, seal=True)
