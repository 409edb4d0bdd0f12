"""Stage draw: a chunk of the draws that decide the claims of a paper, in this one process."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from reobserve.core.errors import InputError, shown
from reobserve.replication.claims.draws_ahead import make_ahead
from reobserve.replication.claims.kept_draws import read_kept
from reobserve.replication.claims.known_draws import write_chunk
from reobserve.replication.claims.registry import read_registry
from reobserve.replication.claims.robustness import Inquiry
from reobserve.replication.evaluation import Evaluator
from reobserve.replication.parameters.ledger import Ledger


def run(
    ledger_file: Path, chunk: str, kept: Path | None, study_files: Sequence[Path], output: Path,
    project: Path,
) -> None:  # fmt: skip
    """Draw and write; `reobserve.cli.stages.robustness` gathers."""
    numbers = numbers_of(chunk)
    ledger = Ledger.read(ledger_file)
    evaluator = Evaluator(ledger)
    if study_files:
        evaluator.take_studies(study_files)
    past = {} if kept is None else read_kept(kept, ledger.paper)
    inquiry = Inquiry.begin(evaluator, read_registry(project, ledger).claims, past)
    bases = {name: one.basis for name, one in inquiry.found.items()}
    write_chunk(output, ledger.paper, bases, make_ahead(inquiry, numbers))


def numbers_of(chunk: str) -> range:
    """The numbers of the samples in a chunk, which is named by its ends, as ``50-99``.

    Raises
    ------
    InputError
        If it is not the name of a chunk.
    """
    ends = re.fullmatch(r"(\d{1,9})-(\d{1,9})", chunk, re.ASCII)
    if ends is None or int(ends[1]) > int(ends[2]):
        raise InputError("chunk", f"{shown(chunk)} must be two rising numbers, as 50-99")
    return range(int(ends[1]), int(ends[2]) + 1)
