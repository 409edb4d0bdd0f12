"""Stage sensitivity: plots of the samples and the alternatives that decide a paper's claims."""

from __future__ import annotations

from pathlib import Path

from reobserve_papers.claims.alternatives import read_alternatives
from reobserve_papers.claims.plot import sensitivity_bars, specification_curves
from reobserve_papers.claims.plot_alternatives import alternatives_curve
from reobserve_papers.claims.registry import read_registry
from reobserve_papers.cli.stages.alternatives import decider_of
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.plotting.fitting import fix_layout
from reobserve_papers.plotting.formats import save


def run(
    parameter_file: Path, robustness_file: Path, alternatives_file: Path, outputs: list[Path],
    project: Path,
) -> None:  # fmt: skip
    """Draw and save. The name of an output, without its suffix, says which plot it is."""
    parameters = Parameters.read(parameter_file)
    registry = read_registry(project, parameters)
    decider = decider_of(parameters, registry, robustness_file)
    title, rows = read_alternatives(alternatives_file)
    verdicts = {name: one.verdict for name, one in decider.judged.items()}
    plots = {
        "alternatives": alternatives_curve(registry.claims, title, rows, verdicts),
        "specification": specification_curves(registry.claims, decider.samples, decider.numbers),
        "sensitivity": sensitivity_bars(registry.claims, decider.samples),
    }
    for name, plot in plots.items():
        fix_layout(plot)
        for output in outputs:
            if output.stem == name:
                save(plot, output)
