"""Margins of bounds and specification curves from samples with known numbers."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from reobserve_papers.claims.checks import Check, Reference
from reobserve_papers.claims.inquiry import Robustness, Trial
from reobserve_papers.claims.margins import format_margins, margins
from reobserve_papers.claims.outcomes import deciding, nested
from reobserve_papers.claims.plot_claims import deciding_check, specification_curves
from reobserve_papers.claims.registry import Claim

BELOW = Check.parse({"value": "fig1 a error", "below": 0.5})
ABOVE = Check.parse({"value": "fig1 a gain", "above": -1.0})
NAMES = ("a.strong", "a.weak", "a.word", "seed")


def claim(*checks: Check) -> Claim:
    return Claim("ilo", "it_is_small", checks=checks, promised=("abstract",))


def numbers(error: float, gain: float = 1.0) -> dict[Reference, float]:
    return {Reference("fig1", "a", "error"): error, Reference("fig1", "a", "gain"): gain}


ONE = claim(BELOW, ABOVE)


def drawn(samples: int = 40) -> Robustness:
    """The error depends on the first choice, hardly on the others."""
    stream = np.random.default_rng(3)
    trials = []
    for k in range(samples):
        strong, weak = stream.random(2)
        error = abs(2 * strong - 1) + 0.01 * weak
        values = (strong, weak, ("x", "y")[k % 2], k)
        trials.append(Trial(partial(tuple, values), numbers(error)))
    return Robustness(NAMES, trials)


def error_of(trial: Trial) -> float:
    assert trial.numbers is not None
    return trial.numbers[Reference("fig1", "a", "error")]


def test_check_that_fails_most_often_decides() -> None:
    never = Check.parse({"value": "fig1 a gain", "above": 2.0})
    for one, check in ((claim(BELOW, ABOVE), 0), (claim(BELOW, never), 1)):
        found = [deciding(one, trial.numbers and nested(trial.numbers)) for trial in drawn().trials]
        assert deciding_check(one, [(), *found]) == check


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


def test_curve_shows_all_samples_in_order() -> None:
    one = drawn()
    figure = specification_curves([claim(BELOW, ABOVE)], {"it_is_small": one}, nested(numbers(0.2)))
    curve, choices = figure.axes
    shown = {line.get_label(): line for line in curve.lines}
    held, failed = shown["claim holds"], shown["claim fails"]
    in_order = sorted(map(error_of, one.trials))
    for line in (held, failed):
        for place, number in zip(line.get_xdata(), line.get_ydata(), strict=True):
            assert in_order[int(place)] == number
    count = sum(error < 0.5 for error in in_order)
    assert (len(held.get_xdata()), len(failed.get_xdata())) == (count, 40 - count)
    assert max(held.get_ydata()) < 0.5 <= min(failed.get_ydata())
    assert [label.get_text() for label in choices.get_yticklabels()] == list(NAMES)


def test_empty_curve_states_the_reason() -> None:
    (text,) = specification_curves([claim(BELOW)], {}, {}).texts
    assert text.get_text().startswith("No ")
