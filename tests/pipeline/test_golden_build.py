"""What is built of the dearest studies is golden, and where a machine differs first is told."""

from __future__ import annotations

import warnings

import pytest

from reobserve.evidence.golden import digests
from reobserve.evidence.golden.comparison import Worst, differences
from reobserve.evidence.golden.files import folder
from reobserve.evidence.golden.kept import kept_paper
from reobserve.replication.evaluation import Evaluator
from tests.evidence.golden.deviations import FEW, deviations

from .conftest import PAPERS, ROOT


@pytest.mark.parametrize(("paper", "figure"), FEW)
def test_the_numbers_of_a_dear_study_are_golden(
    evaluators: dict[str, Evaluator], paper: str, figure: str
) -> None:
    assert list(deviations(evaluators[paper], figure)) == []


@pytest.mark.parametrize("paper", PAPERS)
def test_a_machine_that_differs_is_told_where(evaluators: dict[str, Evaluator], paper: str) -> None:
    """No failure: a warning in the summary, of the first stage that differs and how far it went."""
    kept = kept_paper(evaluators[paper])
    said = digests.first_difference(folder(ROOT, paper), kept.digests)
    if said:
        every = (
            one
            for part, numbers in kept.parts.items()
            for one in differences(numbers, paper, part, folder(ROOT, paper))
        )
        worst = Worst.of(every)
        said = f"{paper}: {said}; at most {worst.ratio:.2g} tolerances: {worst.what}"
        warnings.warn(said, stacklevel=1)
