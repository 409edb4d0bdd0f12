"""Numerical settings decide no claim: refining them reverses none."""

from __future__ import annotations

import copy
from typing import Any

import pytest

from reobserve_papers.claims.outcomes import Outcomes, nested, outcome
from reobserve_papers.claims.registry import read_registry
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.steps.evaluation import Evaluator
from tests.reobserve_papers.pipeline.conftest import PAPERS, PARAMETER_FILES, ROOT

pytestmark = pytest.mark.nightly

STEPS = ("step", "period")  # endings of time step keys, which are refined together


def numerical(paper: str) -> dict[str, list[str]]:
    """The settings that are refined together, by name."""
    keys = [key for key, entry in PARAMETER_FILES[paper].entries() if entry.get("numerical")]
    found = {key: [key] for key in keys if not key.endswith(STEPS)}
    return {"steps": [key for key in keys if key.endswith(STEPS)], **found}


def refined(entry: dict[str, Any], key: str) -> Any:
    """Half of a step, or twice a number of points, runs or terms, within the range of the entry."""
    if key.endswith(STEPS):
        return entry["value"] / 2
    value, span = 2 * entry["value"], entry.get("range")
    return min(value, span[1]) if isinstance(span, list) else value


SETTINGS = [
    pytest.param(paper, keys, id=f"{paper}-{name}")
    for paper in PAPERS
    for name, keys in numerical(paper).items()
]


@pytest.fixture(scope="module")
def evaluators() -> dict[str, Outcomes]:
    """The evaluations that the claims of each paper need, computed once."""
    return {}


@pytest.mark.parametrize(("paper", "keys"), SETTINGS)
def test_refined_settings_reverse_no_claim(
    paper: str, keys: list[str], evaluators: dict[str, Outcomes]
) -> None:
    parameters = PARAMETER_FILES[paper]
    claims = [claim for claim in read_registry(ROOT, parameters).claims if claim.checks]
    if paper not in evaluators:
        evaluators[paper] = Outcomes(Evaluator(parameters), claims)
    tree = copy.deepcopy(parameters.tree)
    for key in keys:
        branch = tree
        for part in key.split("."):
            branch = branch[part]
        branch["value"] = refined(branch, key)
    finer = evaluators[paper].isolated().at(Parameters(paper, tree, parameters.seed), claims)
    for claim in claims:
        stated = evaluators[paper].nominal(claim)
        assert stated is not None
        assert outcome(claim, nested(finer[claim.name])) == outcome(claim, nested(stated))
