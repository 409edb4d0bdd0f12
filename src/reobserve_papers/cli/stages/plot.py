"""Stage plot: one figure in every format asked for, and its caption."""

from __future__ import annotations

from pathlib import Path

from reobserve.core.files import write_text
from reobserve_papers.cli.stages.records import read_estimates, read_record
from reobserve_papers.metrics.metrics import read_metrics
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.plotting.captions import render, with_note
from reobserve_papers.plotting.figures import note_of
from reobserve_papers.plotting.formats import save
from reobserve_papers.plotting.look import use_sheet
from reobserve_papers.steps.compute import read_study, rows_from
from reobserve_papers.steps.evaluation import Replication, draw


def run(
    parameter_file: Path,
    figure: str,
    plant_file: Path,
    estimate_files: list[Path],
    study_file: Path | None,
    metrics_file: Path,
    template: Path,
    outputs: list[Path],
    caption: Path,
    style: Path | None = None,
    notes: bool = True,
) -> None:
    """Draw, save and caption. The estimates come in the order the figure names observers.

    ``style`` is a sheet of matplotlib's; without ``notes`` they go into the caption.
    """
    use_sheet(style)
    parameters = Parameters.read(parameter_file)
    settings = parameters.settings("plot", figure)
    metrics = read_metrics(metrics_file)
    text = render(template, settings, metrics)
    plant = read_record(plant_file, parameters, settings["figure"]["scenario"])
    estimates = read_estimates(settings["figure"]["observers"], estimate_files, parameters, plant)
    study = read_study(parameters.package, study_file)
    with rows_from(study_file):
        drawing = draw(
            Replication(parameters, figure, plant, estimates, study, metrics), notes=notes
        )
    for output in outputs:
        save(drawing, output)
    write_text(caption, text if notes else with_note(text, note_of(drawing)))
