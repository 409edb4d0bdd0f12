"""Margins of thresholds: how far each may be moved without another verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from reobserve_papers.claims.checks import Check
from reobserve_papers.claims.outcomes import Outcome
from reobserve_papers.claims.registry import Claim, Quantifier
from reobserve_papers.claims.robustness import finding

_MOVABLE = ("below", "above")


def margins(
    claim: Claim, stated: Outcome, drawn: Sequence[Outcome] = ()
) -> dict[Check, tuple[float, float]]:
    """Values between which a bound may be without another verdict, by check with one bound.

    The outcomes are those with the parameter file as it is and of the samples. The ends are numbers
    at which an outcome turns over, or infinite.
    """
    return {
        check: (_end(claim, k, stated, drawn, -1), _end(claim, k, stated, drawn, 1))
        for k, check in enumerate(claim.checks)
        if check.relation in _MOVABLE
    }


def format_margins(found: dict[Check, tuple[float, float]]) -> str:
    """The same for a reader."""
    return "; ".join(
        f"{check.relation} {check.bound:g} could be {_format(low, high)}"
        for check, (low, high) in found.items()
    )


def _format(low: float, high: float) -> str:
    if math.isinf(low) and math.isinf(high):
        return "any"
    if math.isinf(high):
        return f"{low:.3g} or more"
    return f"{high:.3g} or less" if math.isinf(low) else f"{low:.3g} to {high:.3g}"


def _end(claim: Claim, k: int, stated: Outcome, drawn: Sequence[Outcome], way: int) -> float:
    """The first number on the way beyond which the verdict is another."""
    bound = claim.checks[k].bound
    verdict = _Verdict.of(claim, k, stated, drawn)
    found = verdict.at(bound)
    ends = {one.numbers[k] for one in (stated, *drawn) if one.numbers}
    ahead = [end for end in ends if math.isfinite(end) and way * end >= way * bound]
    ahead.sort(reverse=way < 0)
    for end, following in pairwise([*ahead, way * math.inf]):
        beyond = (end + following) / 2 if math.isfinite(following) else end + way
        if verdict.at(beyond) != found:
            return end
    return way * math.inf


@dataclass(frozen=True)
class _Verdict:
    """Verdict on whether a claim holds, and whether that is firm, by the bound of one check.

    ``numbers`` are those that decide the check, as stated and in the samples, and ``others`` tells
    where all other checks hold, both of shape (1 + samples,).
    """

    quantifier: Quantifier
    check: Check
    numbers: NDArray[np.float64]
    others: NDArray[np.bool_]

    @classmethod
    def of(cls, claim: Claim, k: int, stated: Outcome, drawn: Sequence[Outcome]) -> _Verdict:
        outcomes = (stated, *drawn)
        rest = [(j, check) for j, check in enumerate(claim.checks) if j != k]
        return cls(
            claim.quantifier,
            claim.checks[k],
            np.array([one.numbers[k] if one.numbers else math.nan for one in outcomes]),
            np.array(
                [
                    bool(one.numbers) and all(c.satisfied_by(one.numbers[j]) for j, c in rest)
                    for one in outcomes
                ]
            ),
        )

    def at(self, bound: float) -> tuple[bool, bool | None]:
        """The verdict with another bound."""
        met = self.numbers < bound if self.check.relation == "below" else self.numbers > bound
        holds, *drawn = (self.others & met).tolist()
        return finding(self.quantifier, holds, sum(drawn), len(drawn))
