"""A claim has the same numbers if all of a theory is computed or only the required part."""

from __future__ import annotations

import pytest

from reobserve.core.documents import read_yaml
from reobserve_papers.claims.checks import THEORY
from reobserve_papers.claims.choices import chosen, with_values
from reobserve_papers.claims.outcomes import Outcomes, taken
from reobserve_papers.claims.registry import read_registry
from reobserve_papers.metrics.metrics import lookup
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator
from tests import ROOT

SEED = read_yaml(ROOT / "config" / "config.yaml")["seed"]


# The computation of parts is shared by all papers.
@pytest.mark.nightly_after(1)
@pytest.mark.parametrize("paper", ["imm", "delay", "ilo", "lie"])
def test_theory_computed_in_parts_agrees_with_the_whole(paper: str) -> None:
    """For a few claims, each at a sample of all its choices."""
    parameters = Parameters.load(ROOT, paper, seed=SEED)
    claims = [
        claim
        for claim in read_registry(ROOT, parameters).claims
        if claim.figures == [THEORY] and claim.choices
    ]
    outcomes = Outcomes(Evaluator(parameters), claims)
    for claim in claims[::4]:
        drawn = with_values(parameters, claim.choices, chosen(parameters, claim.choices, 1))
        whole = taken(claim.wanted, {THEORY: lookup(Evaluator(drawn).theory())})
        assert repr(outcomes.at(drawn, [claim])[claim.name]) == repr(whole)
