"""Nulls: an estimator that knows nothing fails the check of a claim in most settings."""

from __future__ import annotations

import numpy as np
import pytest

from reobserve_papers.claims.inquiry import counted
from reobserve_papers.claims.outcomes import nested, outcome
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


@pytest.mark.parametrize("claim", CLAIMS)
def test_null_fails_in_most_samples(claim: Claim) -> None:
    """Else the check says nothing of the estimate, and must be another one."""
    named = {ref for check in claim.with_null.checks for ref in check.references}
    samples = CACHED[claim.paper].get(claim.name)
    if samples is None or not named.issubset(samples.references):
        pytest.skip("samples are not cached; test_sample_table fails then, too")
    found = map(samples.at, range(len(samples.samples)))
    words = [outcome(claim.with_null, one and nested(one)) for one in found]
    assert words.count("holds") < counted(words).samples / 2


@pytest.mark.parametrize("paper", PAPERS)
def test_no_sample_is_divided_by_rounding(paper: str) -> None:
    """No number by which a check or an alternative divides is tiny beside those of other samples.

    Unless the same claim bounds the difference, too: then no quotient of tiny numbers decides. A
    lag that is exactly zero is no rounding.
    """
    registry = read_registry(ROOT, Parameters.load(ROOT, paper))
    single = [one for one in registry.conventions.single.values() if one.paper == paper]
    others = [
        registry.variant(name, registry.conventions, changes)
        for one in single
        for name, changes in one.claims.items()
    ]
    for claim in [*registry.claims, *others]:
        if (samples := CACHED[paper].get(claim.name)) is None:
            continue
        checks = [*claim.checks, *(claim.with_null.checks if claim.null else ())]
        bounded = {ref for check in checks if check.how == "minus" for ref in check.other}
        divisors = {ref for check in checks if check.how == "over" for ref in check.other}
        found = [samples.at(k) or {} for k in range(len(samples.samples))]
        for ref in divisors - bounded:
            sizes = np.abs([one[ref] for one in found if ref in one])
            sizes = sizes[sizes > 0]
            assert sizes.min() > 1e-9 * np.median(sizes), (claim.name, ref)


def test_main_claims_with_nulls_name_observers_that_there_are() -> None:
    """The numbers of nulls are wanted like any others."""
    for parameter in CLAIMS:
        (claim,) = parameter.values
        assert isinstance(claim, Claim)
        nulls = {ref for check in claim.with_null.checks for ref in check.references}
        assert nulls <= set(claim.wanted)
