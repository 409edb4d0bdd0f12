"""Stage robustness: samples of the claims of a paper, in this one process."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from reobserve.core.files import write_text
from reobserve.core.seals import sealed
from reobserve_papers.claims.cached_samples import read_cached
from reobserve_papers.claims.known_samples import read_chunks
from reobserve_papers.claims.registry import read_registry
from reobserve_papers.claims.robustness import assess
from reobserve_papers.claims.robustness_file import to_data
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator


def run(
    parameter_file: Path, samples: int, cached: Path | None,
    chunk_files: Sequence[Path], study_files: Sequence[Path], output: Path, project: Path,
) -> None:  # fmt: skip
    """Sample and write. A claim that is broken is left to the table of claims."""
    parameters = Parameters.read(parameter_file)
    past = None if cached is None else read_cached(cached, parameters.paper)
    made = read_chunks(chunk_files, parameters.paper)
    evaluator = Evaluator(parameters)
    if study_files:
        evaluator.take_studies(study_files)
    registry = read_registry(project, parameters)
    share = registry.conventions.values["share"]
    found = assess(evaluator, registry.claims, lambda _: samples, share, past, made)
    stored = {
        "paper": parameters.paper,
        "seed": parameters.seed,
        "samples": samples,
        "claims": {
            claim.name: to_data(claim, found[claim.name])
            for claim in registry.claims
            if claim.name in found
        },
    }
    write_text(output, json.dumps(sealed(stored), ensure_ascii=False) + "\n")
