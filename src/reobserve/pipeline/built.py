"""What a build has made and an evaluation need not make again: its studies.

Its theory is computed once more: that tells which part of it gives which numbers, so that draws
compute what they need of it alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from reobserve.errors import InputError, shown
from reobserve.ledger.ledger import Ledger
from reobserve.pipeline.common import read_study
from reobserve.pipeline.evaluation import Evaluator


def evaluator_after(ledger: Ledger, study_files: Sequence[Path] = ()) -> Evaluator:
    """An evaluator of the ledger that takes from files the studies that were made of it.

    Parameters
    ----------
    ledger
        What the files were made of.
    study_files
        Of all its studies, in the order of the ledger, or none.

    Raises
    ------
    InputError
        If a file is missing or damaged or of another study, or there are not as many as there are
        studies. Rows that a figure misses are told where it is evaluated, see `Evaluator.figure`.
    """
    evaluator = Evaluator(ledger)
    studies = ledger.tree.get("studies", {})
    if study_files and len(study_files) != len(studies):
        raise InputError(
            "--study-files", f"{len(study_files)} must be one for each of {list(studies)}"
        )
    for name, path in zip(studies, study_files, strict=False):
        if path.name != (wanted := f"{name}.study.csv"):
            raise InputError("--study-files", f"{shown(path.name)} stands where {wanted} must")
        evaluator.take("study", read_study(ledger.paper, path), path, study=name)
    return evaluator
