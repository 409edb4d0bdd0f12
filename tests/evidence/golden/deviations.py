"""What is off of golden numbers, and studies so dear that few of their levels are tried on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from reobserve.evidence.golden.comparison import compare
from reobserve.evidence.golden.deviation import Deviation
from reobserve.evidence.golden.files import folder, read_metrics
from reobserve.evidence.golden.kept import by_name, kept_parts
from reobserve.replication.evaluation import Evaluator
from tests.pipeline.conftest import FEW_LEVELS, LEDGERS, PAPERS, ROOT


def deviations(evaluator: Evaluator, part: str, kept: Path | None = None) -> Iterator[str]:
    """What is off of a figure with its records, a table or the theory."""
    paper = evaluator.ledger.paper
    golden = kept or folder(ROOT, paper)
    for name, found in kept_parts(evaluator, part).items():
        yield from map(str, compare(found, paper, name, golden))


def deviations_of_few(evaluator: Evaluator, figure: str) -> Iterator[str]:
    """What is off of a figure's metrics that a study of few levels has."""
    golden = read_metrics(folder(ROOT, evaluator.ledger.paper), figure)
    found = by_name(evaluator.figure(figure).numbers)
    assert len(found.keys() & golden.keys()) > len(found) / 2
    for name in found.keys() & golden.keys():
        kept, value = golden[name], float(found[name].values[0])
        one = Deviation(figure, name, float(kept.values[0]), value, kept.tolerance.allowed)
        if one.exceeds:
            yield str(one)


FEW = [
    (paper, figure)
    for paper in PAPERS
    for figure, body in LEDGERS[paper].tree["figures"].items()
    if body.get("study") in FEW_LEVELS
]
