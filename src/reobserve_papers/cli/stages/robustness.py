"""Stage robustness: samples of the claims of a paper, in this one process."""

from __future__ import annotations

from pathlib import Path

from reobserve_papers.claims.inquiry import Inquiry
from reobserve_papers.claims.registry import read_registry
from reobserve_papers.claims.sample_table import read_cached, write_samples
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.chain import project_of, reads, result
from reobserve_papers.steps.evaluation import Evaluator


def run(parameter_file: Path, samples: int, cached: bool) -> None:
    """Sample and write. A claim that is broken is left to the table of claims."""
    parameters = Parameters.read(parameter_file)
    project = project_of(parameter_file, parameters)
    paper, evaluator = parameters.paper, Evaluator(parameters)
    for step, *names in reads(parameters, "robustness"):
        evaluator.take_study(names[0], project / result(paper, step, *names))
    registry = read_registry(project, parameters)
    share = registry.conventions.values["share"]
    past = read_cached(project, paper) if cached else None
    inquiry = Inquiry.begin(evaluator, registry.claims, share, past)
    inquiry.fill(lambda _: samples)
    write_samples(project / result(paper, "robustness"), parameters, inquiry.to_keep())
