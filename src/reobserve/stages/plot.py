"""Stage plot: one figure in every format asked for, and its caption."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from reobserve.drawing.captions import render, with_note
from reobserve.drawing.figures import note_of
from reobserve.drawing.fitting import fix_layout
from reobserve.drawing.formats import save
from reobserve.drawing.look import use_sheet
from reobserve.errors import located
from reobserve.ledger.ledger import Ledger
from reobserve.pipeline.common import paper_module, read_study, rows_from
from reobserve.pipeline.figures import figure_data
from reobserve.plain_data.files import write_text
from reobserve.scoring.metrics import lookup, read_metrics
from reobserve.stages.records import read_estimates, read_record


def run(
    ledger_file: Path,
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
    """Draw, save and caption; the estimates come in the order the figure names observers.

    ``style`` is a sheet of matplotlib's; without ``notes`` they go into the caption.
    """
    use_sheet(style)
    ledger = Ledger.read(ledger_file)
    settings = ledger.settings("plot", figure)
    metrics = read_metrics(metrics_file)
    text = render(template, settings, metrics)
    plant = read_record(plant_file, ledger, settings["figure"]["scenario"])
    estimates = read_estimates(settings["figure"]["observers"], estimate_files, ledger, plant)
    study = read_study(ledger.paper, study_file)
    data = figure_data(ledger.paper, settings, plant, estimates, study)
    layouts = paper_module(ledger.paper, "plot").LAYOUTS
    with located(f"{ledger.paper}.figures.{figure}"), rows_from(study_file):
        drawing = layouts[data.job.figure.layout](replace(data, metrics=lookup(metrics)))
    fix_layout(drawing, notes=notes)
    for output in outputs:
        save(drawing, output)
    write_text(caption, text if notes else with_note(text, note_of(drawing)))
