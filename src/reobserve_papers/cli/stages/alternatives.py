"""Stage alternatives: what each alternative to a convention changes of a paper's verdicts."""

from __future__ import annotations

from pathlib import Path

from reobserve_papers.claims.decider import Decider
from reobserve_papers.claims.inquiry import read_robustness
from reobserve_papers.claims.registry import read_registry
from reobserve_papers.claims.title import write_alternatives
from reobserve_papers.metrics.metrics import lookup, read_metrics
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.chain import project_of, reads, result


def run(parameter_file: Path) -> None:
    """Re-evaluate the samples by each alternative, and write what changes."""
    parameters = Parameters.read(parameter_file)
    project = project_of(parameter_file, parameters)
    rows = decider_of(project, parameters).rows()
    write_alternatives(project / result(parameters.paper, "alternatives"), rows)


def decider_of(project: Path, parameters: Parameters) -> Decider:
    """Whoever decides the claims of a paper, from the metrics and samples of a build."""
    registry, numbers = read_registry(project, parameters), {}
    for step in reads(parameters, "alternatives"):
        path = project / result(parameters.paper, *step)
        if step[0] == "robustness":
            samples = read_robustness(path, parameters, registry.claims)
        else:  # of a figure, or of the theory, by its name
            numbers[step[-1]] = lookup(read_metrics(path))
    return Decider(registry, numbers, samples, parameters.seed)
