"""Stage plot: one figure in every format asked for, and its caption."""

from __future__ import annotations

from pathlib import Path

from reobserve.core.files import write_text
from reobserve_papers.parameters.config import known_styles, refuse_unknown
from reobserve_papers.parameters.names import caption_template, style_sheet
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.plotting.captions import render, with_note
from reobserve_papers.plotting.figures import note_of
from reobserve_papers.plotting.formats import save
from reobserve_papers.plotting.style_sheet import use_sheet
from reobserve_papers.steps.build_job import stored, study_file
from reobserve_papers.steps.chain import project_of, result
from reobserve_papers.steps.evaluation import Replication, draw
from reobserve_papers.steps.figures import behind_figure, rows_from


def run(
    parameter_file: Path, figure: str, formats: list[str], style: str = "", notes: bool = True
) -> None:
    """Draw, save and caption.

    ``style`` is the name of a sheet of matplotlib's; without ``notes`` they go into the caption.
    """
    parameters = Parameters.read(parameter_file)
    settings = parameters.settings("plot", figure)
    project, paper = project_of(parameter_file, parameters), parameters.paper
    if style:
        refuse_unknown("--style", [style], known_styles(project))
    use_sheet(project / style_sheet(project, style) if style else None)
    inputs = stored(parameters, project, "plot", figure)
    metrics = inputs["metrics", figure]
    text = render(project / caption_template(project, paper, figure, "figure"), settings, metrics)
    shown = Replication(parameters, figure, *behind_figure(inputs), metrics)
    with rows_from(study_file(parameters, project, inputs)):
        drawing = draw(shown, notes=notes)
    caption = project / result(paper, "plot", figure)
    for kind in formats:
        save(drawing, caption.with_name(f"{figure}.{kind}"))
    write_text(caption, text if notes else with_note(text, note_of(drawing)))
