"""A chunk of samples, made ahead of those who decide claims by them."""

from __future__ import annotations

from reobserve_papers.claims.outcomes import Found
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.robustness import Inquiry


def make_ahead(inquiry: Inquiry, numbers: range) -> dict[str, dict[int, Found | None]]:
    """The samples of a chunk by claim, without those that are cached.

    Nothing is sampled of a claim that the cached samples before the chunk decide. Chunks do not
    wait for each other, so a chunk may sample what nobody will need; it cannot sample what would
    decide otherwise.
    """
    known = inquiry.known
    joined = {claim.name for claim in inquiry.claims if _joins(inquiry, claim, numbers.start)}
    for number in numbers:
        going = [claim for claim in inquiry.claims if not inquiry.decided(claim)]
        inquiry.ask(number, [claim for claim in going if number not in known[claim.name]])
        for claim in going:
            if claim.name in joined and number in known[claim.name]:
                inquiry.add(number, claim)
    return {
        name: {number: one.made[number] for number in numbers if number in one.made}
        for name, one in known.items()
    }


def _joins(inquiry: Inquiry, claim: Claim, start: int) -> bool:
    """Take all samples of a claim before ``start`` that are known, and return whether it is all."""
    for number in range(start):
        if inquiry.decided(claim):
            break
        if number not in inquiry.known[claim.name]:
            return False
        inquiry.add(number, claim)
    return True
