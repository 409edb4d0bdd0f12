"""Stage sample: a chunk of the samples that decide the claims of a paper, in this one process."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from reobserve.core.errors import InputError, shown
from reobserve_papers.claims.registry import read_registry
from reobserve_papers.claims.robustness import Inquiry
from reobserve_papers.claims.samples import read_samples, write_samples
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator


def run(
    parameter_file: Path, chunk: str, cached: Path | None, study_files: Sequence[Path],
    output: Path, project: Path,
) -> None:  # fmt: skip
    """Sample and write. `reobserve_papers.cli.stages.robustness` gathers."""
    numbers = numbers_of(chunk)
    parameters = Parameters.read(parameter_file)
    evaluator = Evaluator(parameters)
    if study_files:
        evaluator.take_studies(study_files)
    past = None if cached is None else read_samples(cached, parameters.paper)
    registry = read_registry(project, parameters)
    share = registry.conventions.values["share"]
    inquiry = Inquiry.begin(evaluator, registry.claims, share, past)
    inquiry.fill(lambda _: numbers.stop, numbers)
    write_samples(output, parameters, inquiry.chunk(numbers))


def numbers_of(chunk: str) -> range:
    """The numbers of the samples in a chunk, which is named by its ends, as ``50-99``."""
    ends = re.fullmatch(r"(\d{1,9})-(\d{1,9})", chunk, re.ASCII)
    if ends is None or int(ends[1]) > int(ends[2]):
        raise InputError("chunk", f"{shown(chunk)} must be two rising numbers, as 50-99")
    return range(int(ends[1]), int(ends[2]) + 1)
