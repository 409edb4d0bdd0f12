"""Sensitivity from samples, with a known deciding choice and a known margin of the bound."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import chatterjeexi

from reobserve_papers.claims.checks import Check
from reobserve_papers.claims.margins import format_margins, margins
from reobserve_papers.claims.outcomes import Outcome
from reobserve_papers.claims.plot import sensitivity_bars, specification_curves
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.robustness import Robustness, Trial
from reobserve_papers.claims.sensitivity import as_places, deciding_check, influences

BELOW = Check.parse({"value": "fig1 a error", "below": 0.5})
ABOVE = Check.parse({"value": "fig1 a gain", "above": -1.0})
NAMES = ("a.strong", "a.weak", "a.word", "seed")


def claim(*checks: Check) -> Claim:
    return Claim("ilo", "it_is_small", checks=checks, promised=("abstract",))


def drawn(samples: int = 40) -> Robustness:
    """The error depends on the first choice, hardly on the others."""
    stream = np.random.default_rng(3)
    trials = []
    for k in range(samples):
        strong, weak = stream.random(2)
        error = abs(2 * strong - 1) + 0.01 * weak
        values = (strong, weak, ("x", "y")[k % 2], k)
        trials.append(Trial(values, Outcome(bool(error < 0.5), (error, 1.0))))
    return Robustness(Outcome(True, (0.2, 1.0)), NAMES, trials)


def test_deciding_choice_explains_nearly_everything() -> None:
    """It decides in the middle of its range, which a correlation would miss; a seed has no
    order."""
    (found,) = influences([drawn(200)])
    assert found[0].name == "a.strong"
    assert {one.name for one in found} == set(NAMES) - {"seed"}
    assert found[0].share > 0.9
    assert found[0].chance < 1e-6
    assert all(abs(one.share) < 0.2 for one in found[1:])


def test_word_separating_all_samples_explains_everything() -> None:
    trials = [Trial((("x", "y")[k % 2],), Outcome(k % 2 == 0, (1.0,))) for k in range(40)]
    (found,) = influences([Robustness(Outcome(True, (1.0,)), ("a.word",), trials)])
    assert found[0].share == pytest.approx(1 - 1 / 20)  # one change of the outcome in 40


def test_dependence_measure_agrees_with_chatterjee() -> None:
    """By its formula with ties: 1 - n sum |r_i+1 - r_i| / (2 sum l_i (n - l_i))."""
    one = drawn(30)
    order = sorted(one.trials, key=lambda trial: trial.values[1])
    held = [trial.outcome.held for trial in order]
    at_most = [sum(other <= each for other in held) for each in held]
    at_least = [sum(other >= each for other in held) for each in held]
    changes = sum(abs(b - a) for a, b in pairwise(at_most))
    expected = 1 - 30 * changes / (2 * sum(n * (30 - n) for n in at_least))
    (found,) = influences([one])
    assert {each.name: each.share for each in found}["a.weak"] == pytest.approx(expected)


def test_p_values_are_corrected_for_multiple_tests() -> None:
    """Benjamini & Yekutieli: p_(i) n (1 + 1/2 + ... + 1/n) / i, the minimum of those from i on."""
    both = influences([drawn(40), drawn(100)])
    alone = [chatterjeexi(*one).pvalue for one in (columns(drawn(40)) + columns(drawn(100)))]
    order = np.sort(alone)
    n = len(alone)
    scaled = order * n * sum(1 / k for k in range(1, n + 1)) / np.arange(1, n + 1)
    expected = np.minimum(1.0, np.minimum.accumulate(scaled[::-1])[::-1])
    found = sorted(bar.chance for bars in both for bar in bars)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def columns(one: Robustness) -> list[tuple[list[float], list[int]]]:
    held = [int(trial.outcome.held) for trial in one.trials]
    return [
        (as_places([trial.values[k] for trial in one.trials]), held)
        for k, name in enumerate(one.names)
        if name != "seed"
    ]


def test_few_samples_give_no_significant_choice() -> None:
    assert influences([drawn(15)]) == [[]]


def test_check_that_fails_most_often_decides() -> None:
    never = Check.parse({"value": "fig1 a gain", "above": 2.0})
    assert deciding_check(claim(BELOW, ABOVE), drawn()) == 0
    assert deciding_check(claim(BELOW, never), drawn()) == 1


def test_bound_margin_agrees_with_sorted_samples() -> None:
    """All of 40 samples lie between 0.1 and 0.49; the 36th in order decides at 0.9."""
    numbers = [0.1 + 0.01 * k for k in range(40)]
    outcomes = [Outcome(True, (number,)) for number in numbers]
    found = margins(claim(BELOW), Outcome(True, (0.2,)), outcomes)
    # One failure in 40 leaves it undecided: the bound may fall to the largest number.
    assert found == {BELOW: (pytest.approx(0.49), math.inf)}
    assert format_margins(found) == "below 0.5 could be 0.49 or more"
    # Without samples only the nominal number decides.
    assert margins(claim(BELOW), Outcome(True, (0.2,))) == {BELOW: (0.2, math.inf)}
    assert margins(claim(BELOW), Outcome(False, (0.7,))) == {BELOW: (-math.inf, 0.7)}
    assert format_margins({BELOW: (-math.inf, 0.7)}) == "below 0.5 could be 0.7 or less"
    assert format_margins({BELOW: (0.1, 0.7)}) == "below 0.5 could be 0.1 to 0.7"
    assert format_margins({BELOW: (-math.inf, math.inf)}) == "below 0.5 could be any"
    # If it fails, in all samples too, the bound may rise to the smallest number.
    outcomes = [Outcome(False, (number + 0.5,)) for number in numbers]
    found = margins(claim(BELOW), Outcome(False, (0.8,)), outcomes)
    assert found == {BELOW: (-math.inf, pytest.approx(0.6))}
    # A check that fails for any bound of the other leaves that bound free.
    never = Check.parse({"value": "fig1 a gain", "above": 2.0})
    both = margins(claim(BELOW, never), Outcome(False, (0.2, 1.0)))
    assert both == {BELOW: (-math.inf, math.inf), never: (1.0, math.inf)}


def test_curve_shows_all_samples_in_order() -> None:
    one = drawn()
    figure = specification_curves([claim(BELOW, ABOVE)], {"it_is_small": one})
    curve, choices = figure.axes
    shown = {line.get_label(): line for line in curve.lines}
    held, failed = shown["claim holds"], shown["claim fails"]
    numbers = sorted(trial.outcome.numbers[0] for trial in one.trials)
    for line in (held, failed):
        for place, number in zip(line.get_xdata(), line.get_ydata(), strict=True):
            assert numbers[int(place)] == number
    assert len(held.get_xdata()) == one.held
    assert len(failed.get_xdata()) == one.samples - one.held
    assert max(held.get_ydata()) < 0.5 <= min(failed.get_ydata())
    assert [label.get_text() for label in choices.get_yticklabels()] == list(NAMES)


def test_bars_are_ordered_by_sensitivity() -> None:
    one = drawn()
    figure = sensitivity_bars([claim(BELOW, ABOVE)], {"it_is_small": one})
    (axes,) = figure.axes
    widths = [bar.get_width() for bar in axes.patches]
    assert widths == sorted(widths, reverse=True)
    assert axes.get_title(loc="left") == f"it is small: held in {one.held} of 40 samples"


def test_empty_sensitivity_figure_states_the_reason() -> None:
    for draw in (specification_curves, sensitivity_bars):
        (text,) = draw([claim(BELOW)], {}).texts
        assert text.get_text().startswith("No ")
