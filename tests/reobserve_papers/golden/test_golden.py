"""The numbers and figures of a build agree with the golden numbers and the accepted figures."""

from __future__ import annotations

import pytest

from reobserve_papers.figure_diff.build_comparison import figures
from reobserve_papers.figure_diff.pixels import TOLERANCE, read_pixels, rms_difference
from reobserve_papers.golden.comparison import compare_built
from reobserve_papers.golden.number_files import golden_files
from reobserve_papers.golden.values import part_names
from tests.reobserve_papers.pipeline.conftest import (
    PAPERS,
    PARAMETER_FILES,
    ROOT,
    Project,
    as_built,
    compared,
)

__all__ = ["as_built", "compared"]

PARTS = [(paper, part) for paper in PAPERS for part in part_names(PARAMETER_FILES[paper].tree)]


@pytest.mark.parametrize(("paper", "part"), PARTS)
def test_numbers_agree_with_golden_files(compared: Project, paper: str, part: str) -> None:
    results = compared.folder / "results" / paper
    moved = compare_built(ROOT, results, PARAMETER_FILES[paper].tree, paper, part)
    assert not moved, "\n".join(map(str, moved))


@pytest.mark.parametrize("paper", PAPERS)
def test_golden_files_belong_to_built_results(paper: str) -> None:
    assert set(golden_files(ROOT, paper)) == set(part_names(PARAMETER_FILES[paper].tree))


@pytest.mark.parametrize("paper", PAPERS)
def test_figures_agree_with_the_accepted_ones(compared: Project, paper: str) -> None:
    accepted = figures(ROOT / "tests/reference" / paper)
    drawn = figures(compared.folder / "results" / paper)
    assert accepted.keys() == drawn.keys()
    far = {}
    for name, path in accepted.items():
        off = rms_difference(read_pixels(path), read_pixels(drawn[name]), f"{paper} {name}")
        if off > TOLERANCE:
            far[name] = off
    assert far == {}
