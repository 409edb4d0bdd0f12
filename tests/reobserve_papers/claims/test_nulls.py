"""Nulls: an estimator that knows nothing fails the check of a claim in most settings."""

from __future__ import annotations

import pytest

from reobserve_papers.claims.outcomes import Sample, nested, outcome
from reobserve_papers.claims.registry import Claim, read_registry
from reobserve_papers.claims.sample_table import read_cached
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

PAPERS = [path.stem for path in sorted((ROOT / "config/claims").glob("*.yaml"))]
CACHED = {paper: read_cached(ROOT, paper).claims for paper in PAPERS}
CLAIMS = [
    pytest.param(claim, id=f"{paper}-{claim.name}")
    for paper in PAPERS
    for claim in read_registry(ROOT, Parameters.load(ROOT, paper)).claims
    if claim.null and claim.choices
]


def holds(claim: Claim, found: Sample | None) -> bool:
    return outcome(claim, None if found is None else nested(found)) == "holds"


@pytest.mark.parametrize("claim", CLAIMS)
def test_null_fails_in_most_samples(claim: Claim) -> None:
    """Else the check says nothing of the estimate, and must be another one."""
    named = {ref for check in claim.with_null.checks for ref in check.references}
    samples = CACHED[claim.paper].get(claim.name)
    if samples is None or not named.issubset(samples.references):
        pytest.skip("samples are not cached; test_sample_table fails then, too")
    passed = [holds(claim.with_null, samples.at(k)) for k in range(len(samples.samples))]
    assert sum(passed) < len(passed) / 2


def test_main_claims_with_nulls_name_observers_that_there_are() -> None:
    """The numbers of nulls are wanted like any others."""
    for parameter in CLAIMS:
        (claim,) = parameter.values
        assert isinstance(claim, Claim)
        nulls = {ref for check in claim.with_null.checks for ref in check.references}
        assert nulls <= set(claim.wanted)
