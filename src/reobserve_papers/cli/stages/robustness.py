"""Stage robustness: samples of the claims of a paper, in this one process."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reobserve_papers.claims.registry import read_registry
from reobserve_papers.claims.robustness import Inquiry
from reobserve_papers.claims.samples import read_samples, write_samples
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator


def run(
    parameter_file: Path, samples: int, cached: Path | None,
    chunk_files: Sequence[Path], study_files: Sequence[Path], output: Path, project: Path,
) -> None:  # fmt: skip
    """Sample and write. A claim that is broken is left to the table of claims."""
    parameters = Parameters.read(parameter_file)
    past = None if cached is None else read_samples(cached, parameters.paper)
    chunks = [read_samples(path, parameters.paper) for path in chunk_files]
    evaluator = Evaluator(parameters)
    if study_files:
        evaluator.take_studies(study_files)
    registry = read_registry(project, parameters)
    share = registry.conventions.values["share"]
    inquiry = Inquiry.begin(evaluator, registry.claims, share, past, chunks)
    inquiry.fill(lambda _: samples)
    write_samples(output, parameters, inquiry.to_keep())
