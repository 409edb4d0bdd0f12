"""Stage table: a table that is a product of its own, from a design to CSV."""

from __future__ import annotations

from pathlib import Path

from reobserve.core.files import write_table
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.compute import compute, named_design, paper_module


def run(parameter_file: Path, table: str, design_file: Path, output: Path) -> None:
    """Fill and write. Nothing is written if the table cannot be filled."""
    parameters = Parameters.read(parameter_file)
    settings = parameters.settings("table", table)
    design = named_design(parameters, settings["table"], design_file)
    rows = compute(parameters, "table", table, settings, *design)
    write_table(output, rows, paper_module(parameters.package, "table").HEADER, seal=True)
