"""Cached samples that a build repeats, to notice that the code gives other numbers now.

Each step that the first two samples of a claim run, and each number that they take, is repeated in
one sample. Studies take seconds, so numbers of a figure whose study runs again count as one: golden
numbers, and the comparison of all samples at night, notice a change of one number alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from reobserve_papers.claims.cached_samples import CachedSamples
from reobserve_papers.claims.checks import THEORY, Reference
from reobserve_papers.claims.choices import chosen, with_values
from reobserve_papers.claims.registry import Claim
from reobserve_papers.steps.chain import Step, behind
from reobserve_papers.steps.evaluation import Evaluator

_TRIED = 2  # first samples of a claim: one may be refused, or the parameter file as it is


def to_repeat(
    evaluator: Evaluator, claims: Iterable[Claim], cached: Mapping[str, CachedSamples]
) -> tuple[dict[str, int], dict[str, int]]:
    """The samples to repeat, and those to repeat if one of them differs, each by its claim's name.

    The latter repeat nothing that the former do not.
    """
    found = {}
    for claim in claims:
        if (past := cached.get(claim.name)) and past.samples:
            tried = range(min(_TRIED, len(past.samples)))
            parts = {number: _parts(evaluator, claim, past, number) for number in tried}
            found[claim.name] = max(parts.items(), key=lambda item: len(item[1]))
    covered: set[Step | Reference] = set()
    needed: dict[str, int] = {}
    others: dict[str, int] = {}
    for name, (number, one) in sorted(found.items(), key=lambda item: -len(item[1][1])):
        (others if one and one <= covered else needed)[name] = number
        covered |= one
    return needed, others


def _parts(
    evaluator: Evaluator, claim: Claim, cached: CachedSamples, number: int
) -> set[Step | Reference]:
    """The steps that a sample runs again and the numbers that it takes, except those of studies."""
    parameters = evaluator.parameters
    values = chosen(parameters, claim.choices, number)
    sample = evaluator.sibling(with_values(parameters, claim.choices, values))
    taken = set(claim.wanted).intersection(cached.found(number) or ())
    parts: set[Step | Reference] = set()
    for figure in {one.figure for one in taken}:
        last = (THEORY,) if figure == THEORY else ("metrics", figure)
        steps = behind(sample.parameters, *last)
        again = {step for step in steps if sample.key(*step) != evaluator.key(*step)}
        parts |= again
        if not any(step[0] == "study" for step in again):
            parts |= {one for one in taken if one.figure == figure}
    return parts
