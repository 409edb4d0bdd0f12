"""A main claim can come out either way: in its samples, or with a spoiled observer or formula."""

from __future__ import annotations

from importlib import import_module

import pytest

from reobserve_papers.claims.outcomes import nested, outcome
from reobserve_papers.claims.registry import Claim, read_registry
from reobserve_papers.claims.sample_table import read_cached
from reobserve_papers.parameters.parameters import Parameters
from tests import FIVE, ROOT


def both_outcomes(claim: Claim) -> bool:
    """True if it holds in some of its samples, and in some it does not."""
    kept = read_cached(ROOT, claim.paper).claims.get(claim.name)
    samples = [kept.at(k) for k in range(len(kept.samples))] if kept else []
    words = {outcome(claim, sample and nested(sample)) for sample in samples}
    return "holds" in words and bool(words & {"tie", "opposed"})


@pytest.mark.parametrize("paper", FIVE)
def test_main_claim_with_one_outcome_is_spoiled_in_a_test_of_its_paper(paper: str) -> None:
    """And no other, so that none is tested that is a claim no more."""
    claims = read_registry(ROOT, Parameters.load(ROOT, paper)).claims
    mains = [claim for claim in claims if claim.is_main and claim.testable]
    place = f"tests.reobserve_papers.papers.{paper}.test_spoiled_claims"
    one_way = {claim.name for claim in mains if not both_outcomes(claim)}
    spoiled = set(import_module(place).SPOILED) if one_way else set()
    assert one_way <= spoiled <= {claim.name for claim in mains}
