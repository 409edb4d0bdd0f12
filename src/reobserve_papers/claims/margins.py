"""Margins of thresholds: how far each may be moved without another verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

from reobserve_papers.claims.checks import Check
from reobserve_papers.claims.outcomes import Sample, deciding, nested
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.verdict_rules import Counted, possible

_MOVABLE = ("below", "above")


def margins(
    claim: Claim, samples: Sequence[Sample | None], whole: bool, share: float
) -> dict[Check, tuple[float, float]]:
    """Values between which a bound may be without another verdict, by check with one bound.

    The ends are numbers at which an outcome turns over, or infinite.
    """
    numbers = [deciding(claim, None if sample is None else nested(sample)) for sample in samples]
    return {
        check: (
            _end(claim, k, numbers, whole, share, -1),
            _end(claim, k, numbers, whole, share, 1),
        )
        for k, check in enumerate(claim.checks)
        if check.relation in _MOVABLE
    }


def format_margins(intervals: dict[Check, tuple[float, float]]) -> str:
    """The same for a reader."""
    alone = len(intervals) == 1
    return "; ".join(
        f"{'' if alone else f'{check.name} '}{check.relation} {_format(low, high)}"
        for check, (low, high) in intervals.items()
    )


def _format(low: float, high: float) -> str:
    if math.isinf(low) and math.isinf(high):
        return "any number"
    if math.isinf(high):
        return f"any number from {low:.3g} on"
    if math.isinf(low):
        return f"any number up to {high:.3g}"
    return f"any number from {low:.3g} to {high:.3g}"


def _end(
    claim: Claim, k: int, numbers: Sequence[tuple[float, ...]], whole: bool, share: float, way: int
) -> float:
    """The first number on the way beyond which the verdict is another."""
    check = claim.checks[k]
    rest = [(j, other) for j, other in enumerate(claim.checks) if j != k]
    # Only where all other checks hold does this bound decide.
    open_ones = [row[k] for row in numbers if row and all(c.satisfied_by(row[j]) for j, c in rest)]

    def verdicts(bound: float) -> tuple[str, ...]:
        moved = replace(check, bound=bound)
        held = sum(moved.satisfied_by(number) for number in open_ones)
        return possible(claim.quantifier, Counted(held, len(numbers), whole), share)

    current = verdicts(check.bound)
    ends = {number for number in open_ones if math.isfinite(number)}
    ahead = [end for end in ends if way * end >= way * check.bound]
    ahead.sort(reverse=way < 0)
    for end, following in pairwise([*ahead, way * math.inf]):
        beyond = (end + following) / 2 if math.isfinite(following) else end + way
        if verdicts(beyond) != current:
            return end
    return way * math.inf
