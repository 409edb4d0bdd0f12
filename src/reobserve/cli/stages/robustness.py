"""Stage robustness: how firmly the claims of a paper stand, in this one process."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from reobserve.core.files import write_text
from reobserve.replication.claims.kept_draws import read_kept
from reobserve.replication.claims.known_draws import read_chunks
from reobserve.replication.claims.registry import read_registry
from reobserve.replication.claims.robustness import assess
from reobserve.replication.claims.robustness_file import to_data
from reobserve.replication.evaluation import Evaluator
from reobserve.replication.parameters.ledger import Ledger


def run(
    ledger_file: Path, draws: int, flips: bool, kept: Path | None, chunk_files: Sequence[Path],
    study_files: Sequence[Path], output: Path, project: Path,
) -> None:  # fmt: skip
    """Draw, move and write; a claim that is broken is left to the table of claims."""
    ledger = Ledger.read(ledger_file)
    past = {} if kept is None else read_kept(kept, ledger.paper)
    made = read_chunks(chunk_files, ledger.paper)
    evaluator = Evaluator(ledger)
    if study_files:
        evaluator.take_studies(study_files)
    found = assess(evaluator, read_registry(project, ledger).claims, draws, flips, past, made)
    stored = {
        "paper": ledger.paper,
        "seed": ledger.seed,
        "draws": draws,
        "claims": {name: to_data(one) for name, one in found.items()},
    }
    write_text(output, json.dumps(stored, ensure_ascii=False, allow_nan=False) + "\n")
