"""The numbers of the last build agree with the accepted ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from reobserve_papers.golden.comparison import compare_built
from reobserve_papers.golden.values import part_names
from reobserve_papers.parameters.parameters import Parameters

ROOT = Path(__file__).parents[1]
PAPERS = {path.stem: Parameters.load(ROOT, path.stem) for path in ROOT.glob("config/papers/*.yaml")}
PARTS = [(paper, part) for paper, found in PAPERS.items() for part in part_names(found.tree)]


@pytest.mark.parametrize(("paper", "part"), PARTS)
def test_numbers_agree_with_the_accepted_ones(paper: str, part: str) -> None:
    moved = compare_built(ROOT, ROOT / "results" / paper, PAPERS[paper].tree, paper, part)
    assert not moved, "\n".join(map(str, moved))
