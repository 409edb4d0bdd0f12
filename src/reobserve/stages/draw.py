"""Stage draw: a chunk of the draws that decide the claims of a paper, in this one process."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reobserve.evidence.claims.draws_ahead import make_ahead
from reobserve.evidence.claims.kept_draws import read_kept
from reobserve.evidence.claims.known_draws import read_chunks, write_chunk
from reobserve.evidence.claims.registry import read_registry
from reobserve.evidence.claims.robustness import Inquiry
from reobserve.ledger.ledger import Ledger
from reobserve.pipeline.built import evaluator_after
from reobserve.pipeline.chunks import numbers_of


def run(
    ledger_file: Path, chunk: str, kept: Path | None, chunk_files: Sequence[Path],
    study_files: Sequence[Path], output: Path, project: Path,
) -> None:  # fmt: skip
    """Draw and write; `reobserve.stages.robustness` gathers."""
    numbers = numbers_of(chunk)
    ledger = Ledger.read(ledger_file)
    past = {} if kept is None else read_kept(kept, ledger.paper)
    made = read_chunks(chunk_files, ledger.paper)
    evaluator = evaluator_after(ledger, study_files)
    inquiry = Inquiry.begin(evaluator, read_registry(project, ledger).claims, past, made)
    bases = {name: one.basis for name, one in inquiry.found.items()}
    write_chunk(output, ledger.paper, bases, make_ahead(inquiry, numbers))
