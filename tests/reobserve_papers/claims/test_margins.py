"""Margins of bounds from samples with known numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from reobserve_papers.claims.checks import Check, Reference
from reobserve_papers.claims.margins import format_margins, margins
from reobserve_papers.claims.registry import Claim

BELOW = Check.parse({"value": "fig1 a error", "below": 0.5})
ABOVE = Check.parse({"value": "fig1 a gain", "above": -1.0})


def claim(*checks: Check) -> Claim:
    return Claim("ilo", "it_is_small", checks=checks, promised=("abstract",))


def numbers(error: float, gain: float = 1.0) -> dict[Reference, float]:
    return {Reference("fig1", "a", "error"): error, Reference("fig1", "a", "gain"): gain}


ONE = claim(BELOW, ABOVE)


def samples(*errors: float) -> list[dict[Reference, float]]:
    return [numbers(error) for error in errors]


def test_bound_margin_agrees_with_sorted_samples() -> None:
    """All of 40 samples lie between 0.1 and 0.49."""
    errors = [0.1 + 0.01 * k for k in range(40)]
    found = margins(claim(BELOW), samples(*errors), False, 0.9)
    # One failure in 40 leaves it undecided: the bound may fall to the largest number.
    assert found == {BELOW: (pytest.approx(0.49), math.inf)}
    assert format_margins(found) == "below any number from 0.49 on"
    # With nine tenths of a count it may fall until more than four fail.
    found = margins(claim(BELOW), samples(*errors), True, 0.9)
    assert found == {BELOW: (pytest.approx(errors[35]), math.inf)}
    found = margins(claim(BELOW), samples(*errors), True, 0.8)
    assert found == {BELOW: (pytest.approx(errors[31]), math.inf)}
    # If it fails in all samples the bound may rise to the smallest number.
    found = margins(claim(BELOW), samples(*(error + 0.5 for error in errors)), False, 0.9)
    assert found == {BELOW: (-math.inf, pytest.approx(0.6))}


def test_bound_margin_of_a_claim_without_choices() -> None:
    """The one number decides."""
    assert margins(claim(BELOW), samples(0.2), True, 0.9) == {BELOW: (0.2, math.inf)}
    assert margins(claim(BELOW), samples(0.7), True, 0.9) == {BELOW: (-math.inf, 0.7)}
    # A check that fails for any bound of the other leaves that bound free.
    never = Check.parse({"value": "fig1 a gain", "above": 2.0})
    both = margins(claim(BELOW, never), samples(0.2), True, 0.9)
    assert both == {BELOW: (-math.inf, math.inf), never: (1.0, math.inf)}
    said = "fig1 a error below any number; fig1 a gain above any number from 1 on"
    assert format_margins(both) == said


def test_bound_margin_of_what_is_always_so_ends_at_the_worst_sample() -> None:
    always = replace(claim(BELOW), quantifier="always")
    errors = [0.1 + 0.01 * k for k in range(40)]
    assert margins(always, samples(*errors), False, 0.9) == {BELOW: (0.49, math.inf)}


@pytest.mark.parametrize(
    ("ends", "said"),
    [
        ((-math.inf, 0.7), "any number up to 0.7"),
        ((0.1, 0.7), "any number from 0.1 to 0.7"),
        ((-math.inf, math.inf), "any number"),
    ],
)
def test_bound_margin_is_put_into_words(ends: tuple[float, float], said: str) -> None:
    assert format_margins({BELOW: ends}) == f"below {said}"
