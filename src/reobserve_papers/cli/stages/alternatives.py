"""Stage alternatives: what each alternative to a convention changes of a paper's verdicts."""

from __future__ import annotations

from pathlib import Path

from reobserve_papers.claims.alternatives import Decider, decide, write_alternatives
from reobserve_papers.claims.checks import THEORY, Numbers
from reobserve_papers.claims.registry import Registry, read_registry
from reobserve_papers.claims.robustness import read_robustness
from reobserve_papers.metrics.metrics import lookup, read_metrics
from reobserve_papers.parameters.parameters import Parameters


def run(parameter_file: Path, robustness_file: Path, output: Path, project: Path) -> None:
    """Re-evaluate the samples by each alternative, and write what changes."""
    parameters = Parameters.read(parameter_file)
    registry = read_registry(project, parameters)
    decider = decider_of(parameters, registry, robustness_file)
    write_alternatives(output, *decide(decider))


def decider_of(parameters: Parameters, registry: Registry, robustness_file: Path) -> Decider:
    """Whoever decides the claims of a paper, from the metrics and samples of a build."""
    numbers = numbers_of(parameters, robustness_file.parent)
    samples = read_robustness(robustness_file, parameters, registry.claims)
    return Decider(registry, numbers, samples, parameters.seed)


def numbers_of(parameters: Parameters, folder: Path) -> Numbers:
    """The metrics of all figures of a paper and of its theory, as built in a folder."""
    named = [*parameters.tree["figures"], *([THEORY] if THEORY in parameters.tree else [])]
    return {name: lookup(read_metrics(folder / f"{name}.metrics.csv")) for name in named}
