"""What metrics mean stands in the code of their paper, and results/README.md says the same."""

from __future__ import annotations

import importlib
import re

import pytest

from reobserve.ledger.config import known_papers
from tests.pipeline.conftest import ROOT


@pytest.mark.parametrize("paper", known_papers(ROOT))
def test_the_list_says_what_the_code_says(paper: str) -> None:
    meanings = importlib.import_module(f"reobserve.papers.{paper}.metrics").MEANINGS
    _, _, section = (ROOT / "results/README.md").read_text().partition(f"## Metrics of `{paper}`")
    rows = re.findall(
        r"^\| `(.+?)` \| .+? \| (.+?) \|$", section.partition("\n## ")[0], re.MULTILINE
    )
    assert {name: text.replace("\\|", "|") for name, text in rows} == meanings
