"""Stages sample and robustness: samples of the claims of a paper, in this one process."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from reobserve.core.errors import InputError, shown
from reobserve_papers.claims.inquiry import Inquiry
from reobserve_papers.claims.registry import read_registry
from reobserve_papers.claims.sample_table import read_cached, read_samples, write_samples
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.chain import project_of, reads, result
from reobserve_papers.steps.evaluation import Evaluator


def run(parameter_file: Path, chunk: Sequence[str], samples: int, cached: bool) -> None:
    """Sample and write. A claim that is broken is left to the table of claims."""
    parameters = Parameters.read(parameter_file)
    project = project_of(parameter_file, parameters)
    inquiry = _begin(parameters, project, cached, chunk)
    inquiry.fill(lambda _: samples)
    output = project / result(parameters.paper, "robustness")
    write_samples(output, parameters, inquiry.to_keep())


def run_chunk(parameter_file: Path, chunk: str, cached: bool) -> None:
    """Sample one chunk and write. `run` gathers chunks."""
    numbers = numbers_of(chunk)
    parameters = Parameters.read(parameter_file)
    project = project_of(parameter_file, parameters)
    inquiry = _begin(parameters, project, cached)
    inquiry.fill(lambda _: numbers.stop, numbers)
    output = project / result(parameters.paper, "sample", chunk)
    write_samples(output, parameters, inquiry.chunk(numbers))


def _begin(
    parameters: Parameters, project: Path, cached: bool, chunks: Sequence[str] = ()
) -> Inquiry:
    """The claims of a paper with the samples that there are, and the studies of a build."""
    paper, evaluator = parameters.paper, Evaluator(parameters)
    tables = []
    for step in reads(parameters, "robustness", *chunks):
        path = project / result(paper, *step)
        if step[0] == "study":
            evaluator.take_study(step[1], path)
        else:
            tables.append(read_samples(path, paper))
    registry = read_registry(project, parameters)
    share = registry.conventions.values["share"]
    past = read_cached(project, paper) if cached else None
    return Inquiry.begin(evaluator, registry.claims, share, past, tables)


def numbers_of(chunk: str) -> range:
    """The numbers of the samples in a chunk, which is named by its ends, as ``50-99``."""
    ends = re.fullmatch(r"(\d{1,9})-(\d{1,9})", chunk, re.ASCII)
    if ends is None or int(ends[1]) > int(ends[2]):
        raise InputError("chunk", f"{shown(chunk)} must be two rising numbers, as 50-99")
    return range(int(ends[1]), int(ends[2]) + 1)
