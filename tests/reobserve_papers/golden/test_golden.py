"""The numbers of a build agree with the golden numbers."""

from __future__ import annotations

import pytest

from reobserve_papers.golden.comparison import compare_built
from reobserve_papers.golden.files import golden_files
from reobserve_papers.golden.values import part_names
from tests.reobserve_papers.pipeline.conftest import (
    PAPERS,
    PARAMETER_FILES,
    ROOT,
    Project,
    as_built,
    built,
)

__all__ = ["as_built", "built"]

PARTS = [(paper, part) for paper in PAPERS for part in part_names(PARAMETER_FILES[paper].tree)]


@pytest.mark.parametrize(("paper", "part"), PARTS)
def test_numbers_agree_with_golden_files(as_built: Project, paper: str, part: str) -> None:
    results = as_built.folder / "results" / paper
    moved = compare_built(ROOT, results, PARAMETER_FILES[paper].tree, paper, part)
    assert not moved, "\n".join(map(str, moved))


@pytest.mark.parametrize("paper", PAPERS)
def test_golden_files_belong_to_built_results(paper: str) -> None:
    assert set(golden_files(ROOT, paper)) == set(part_names(PARAMETER_FILES[paper].tree))
