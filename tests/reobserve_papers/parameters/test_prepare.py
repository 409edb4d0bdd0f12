"""Which papers a build reads."""

from __future__ import annotations

from typing import Any

import pytest

from reobserve.core.errors import InputError
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.prepare import load_parameters
from tests import ROOT

BASE = {
    "formats": ["pdf"],
    "seed": 1,
    "samples": 1,
    "chunks": 1,
    "reversals": False,
    "cached": True,
}
PAPERS = known_papers(ROOT)


@pytest.mark.parametrize(
    ("targets", "changes", "read"),
    [
        (["results/ilo/fig1.pdf"], {}, ["ilo"]),
        (["results/ilo/constant/plant.parquet", "results/eso/fig2.pdf"], {}, ["eso", "ilo"]),
        (["results/ilo/fig1.pdf"], {"eso": {"plant": {"step": 5e-4}}}, ["eso", "ilo"]),
        (["results/lie/fig1.pdf"], {"papers": ["ilo"]}, ["lie"]),
        ([], {"papers": ["ilo", "eso"]}, ["eso", "ilo"]),
        ([], {}, PAPERS),
        (["results/ilo/fig1.pdf", "figures"], {}, PAPERS),
        (["results/claims.csv"], {}, PAPERS),
        (["results/bench/table.md"], {}, PAPERS),
    ],
)
def test_papers_that_are_not_asked_for_are_not_read(
    targets: list[str], changes: dict[str, Any], read: list[str]
) -> None:
    assert list(load_parameters(ROOT, {**BASE, **changes}, targets)) == read


def test_overrides_of_other_papers_are_checked() -> None:
    with pytest.raises(InputError, match=r"^lie\.plant\.stepp: unknown key"):
        load_parameters(ROOT, {**BASE, "lie": {"plant": {"stepp": 1}}}, ["results/ilo/fig1.pdf"])
