"""Stage metrics: the numbers of one figure, from the records to a table."""

from __future__ import annotations

from pathlib import Path

from reobserve_papers.cli.stages.records import read_estimates, read_record
from reobserve_papers.metrics.metrics import write_metrics
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.compute import figure_data, measure, read_study, rows_from
from reobserve_papers.steps.meanings import check_meanings


def run(
    parameter_file: Path,
    figure: str,
    plant_file: Path,
    estimate_files: list[Path],
    study_file: Path | None,
    output: Path,
) -> None:
    """Compute and write. The estimates come in the order in which the figure names observers."""
    parameters = Parameters.read(parameter_file)
    settings = parameters.settings("metrics", figure)
    plant = read_record(plant_file, parameters, settings["figure"]["scenario"])
    estimates = read_estimates(settings["figure"]["observers"], estimate_files, parameters, plant)
    study = read_study(parameters.package, study_file)
    with rows_from(study_file):
        found = measure(parameters, figure_data(parameters, settings, plant, estimates, study))
    check_meanings(parameters.package, found)
    write_metrics(output, found)
