"""Sensitivity from samples, with a known deciding choice and a known margin of the bound."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import chatterjeexi

from reobserve_papers.claims.checks import Check, Reference
from reobserve_papers.claims.influences import as_places, deciding_check, influences
from reobserve_papers.claims.inquiry import Robustness, Trial
from reobserve_papers.claims.margins import format_margins, margins
from reobserve_papers.claims.outcomes import nested
from reobserve_papers.claims.plot_claims import sensitivity_bars, specification_curves
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


def test_deciding_choice_explains_nearly_everything() -> None:
    """It decides in the middle of its range, which a correlation would miss; a seed has no
    order."""
    (found,) = influences([(ONE, drawn(200))])
    assert found[0].name == "a.strong"
    assert {one.name for one in found} == set(NAMES) - {"seed"}
    assert found[0].share > 0.9
    assert found[0].chance < 1e-6
    assert all(abs(one.share) < 0.2 for one in found[1:])


def test_word_separating_all_samples_explains_everything() -> None:
    trials = [Trial(partial(tuple, "xy"[k % 2]), numbers(k % 2)) for k in range(40)]
    (found,) = influences([(ONE, Robustness(("a.word",), trials))])
    assert found[0].share == pytest.approx(1 - 1 / 20)  # one change of the outcome in 40


def test_dependence_measure_agrees_with_chatterjee() -> None:
    """By its formula with ties: 1 - n sum |r_i+1 - r_i| / (2 sum l_i (n - l_i))."""
    one = drawn(30)
    order = sorted(one.trials, key=lambda trial: trial.values[1])
    held = [error_of(trial) < 0.5 for trial in order]
    at_most = [sum(other <= each for other in held) for each in held]
    at_least = [sum(other >= each for other in held) for each in held]
    changes = sum(abs(b - a) for a, b in pairwise(at_most))
    expected = 1 - 30 * changes / (2 * sum(n * (30 - n) for n in at_least))
    (found,) = influences([(ONE, one)])
    assert {each.name: each.share for each in found}["a.weak"] == pytest.approx(expected)


def test_p_values_are_corrected_for_multiple_tests() -> None:
    """Benjamini & Yekutieli: p_(i) n (1 + 1/2 + ... + 1/n) / i, the minimum of those from i on."""
    both = influences([(ONE, drawn(40)), (ONE, drawn(100))])
    alone = [chatterjeexi(*one).pvalue for one in (columns(drawn(40)) + columns(drawn(100)))]
    order = np.sort(alone)
    n = len(alone)
    scaled = order * n * sum(1 / k for k in range(1, n + 1)) / np.arange(1, n + 1)
    expected = np.minimum(1.0, np.minimum.accumulate(scaled[::-1])[::-1])
    found = sorted(bar.chance for bars in both for bar in bars)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def error_of(trial: Trial) -> float:
    assert trial.numbers is not None
    return trial.numbers[Reference("fig1", "a", "error")]


def columns(one: Robustness) -> list[tuple[list[float], list[int]]]:
    held = [int(error_of(trial) < 0.5) for trial in one.trials]
    return [
        (as_places([trial.values[k] for trial in one.trials]), held)
        for k, name in enumerate(one.names)
        if name != "seed"
    ]


def test_few_samples_give_no_significant_choice() -> None:
    assert influences([(ONE, drawn(15))]) == [[]]


def test_check_that_fails_most_often_decides() -> None:
    never = Check.parse({"value": "fig1 a gain", "above": 2.0})
    assert deciding_check(claim(BELOW, ABOVE), drawn()) == 0
    assert deciding_check(claim(BELOW, never), drawn()) == 1


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


def test_bars_are_ordered_by_sensitivity() -> None:
    one = drawn()
    figure = sensitivity_bars([claim(BELOW, ABOVE)], {"it_is_small": one})
    (axes,) = figure.axes
    widths = [bar.get_width() for bar in axes.patches]
    assert widths == sorted(widths, reverse=True)
    (title,) = axes.texts
    held = one.outcomes(ONE).count("holds")
    assert title.get_text() == f"it is small: held in {held} of 40 samples"


def test_empty_sensitivity_figure_states_the_reason() -> None:
    for figure in (
        specification_curves([claim(BELOW)], {}, {}),
        sensitivity_bars([claim(BELOW)], {}),
    ):
        (text,) = figure.texts
        assert text.get_text().startswith("No ")
