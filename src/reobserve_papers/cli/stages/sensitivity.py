"""Stage sensitivity: plots of the samples and the alternatives that decide a paper's claims."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reobserve_papers.claims.plot_alternatives import alternatives_curve
from reobserve_papers.claims.plot_claims import sensitivity_bars
from reobserve_papers.claims.title import read_alternatives
from reobserve_papers.cli.stages.alternatives import decider_of
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.plotting.fitting import fix_layout
from reobserve_papers.plotting.formats import save
from reobserve_papers.steps.chain import CLAIM_PLOTS, project_of, result


def run(parameter_file: Path, formats: Sequence[str]) -> None:
    """Draw the plots `CLAIM_PLOTS`, and save each in all formats."""
    parameters = Parameters.read(parameter_file)
    project = project_of(parameter_file, parameters)
    decider = decider_of(project, parameters)
    claims = decider.registry.claims
    path = project / result(parameters.paper, "alternatives")
    title, rows = read_alternatives(path)
    verdicts = {name: judgement.verdict for name, judgement in decider.judged.items()}
    plots = (
        alternatives_curve(title, rows, verdicts),
        sensitivity_bars(claims, decider.samples, verdicts),
    )
    for name, plot in zip(CLAIM_PLOTS, plots, strict=True):
        fix_layout(plot)
        for kind in formats:
            save(plot, path.with_name(f"{name}.{kind}"))
