"""The choice that separates outcomes: by brute force, with planted choices and without any."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from reobserve.core.documents import read_yaml
from reobserve_papers.claims import separation as module
from reobserve_papers.claims.checks import Check, Reference
from reobserve_papers.claims.inquiry import Robustness, Trial, read_robustness
from reobserve_papers.claims.labels import Label
from reobserve_papers.claims.plot_claims import sensitivity_bars
from reobserve_papers.claims.registry import Claim, read_registry
from reobserve_papers.claims.separation import (
    DECIDES,
    SIDE,
    Split,
    best_split,
    halves,
    in_words,
    rounded,
    separation,
)
from reobserve_papers.claims.verdict_rules import DEPENDS, REPRODUCED, UNDECIDED
from reobserve_papers.parameters.names import samples_path
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

Mask = NDArray[np.bool_]

BELOW = Check.parse({"value": "fig1 a error", "below": 0.5})
LABELS = {
    "a.gain": Label("gain", "observer a", "1/s"),
    "a.word": Label("word", "observer a", readings={"x_y": "x y"}),
}


def claim(name: str = "it_is_small") -> Claim:
    return Claim("ilo", name, checks=(BELOW,), labels=LABELS)


def samples(held: Sequence[Any], whole: bool = False, **columns: Sequence[Any]) -> Robustness:
    """Samples with values of choices ``a.<name>``, in which the claim holds or not."""
    names = tuple(f"a.{name}" for name in columns)
    rows = zip(*columns.values(), strict=True) if columns else ((),) * len(held)
    trials = [
        Trial(partial(tuple, row), {Reference("fig1", "a", "error"): 0.0 if holds else 1.0})
        for row, holds in zip(rows, held, strict=True)
    ]
    return Robustness(names, trials, whole=len(trials) if whole else None)


def separated(robustness: Robustness) -> module.Separation:
    return separation(claim(), robustness, robustness.outcomes(claim()))


def gini(held: Mask) -> float:
    return 2 * held.mean() * (1 - held.mean()) if len(held) else 0.0


def explained_by(side: Mask, held: Mask) -> float:
    """By the definition: the fall of the impurity, weighted by the samples of the sides."""
    if gini(held) == 0.0:
        return 0.0
    left = sum(part.mean() * gini(held[part]) for part in (side, ~side))
    return 1 - left / gini(held)


OUTCOMES = st.integers(2, 40).flatmap(
    lambda n: st.tuples(
        st.lists(st.booleans(), min_size=n, max_size=n),
        st.lists(st.sampled_from("abcde"), min_size=n, max_size=n),
        st.lists(st.integers(-9, 9) | st.floats(-1, 1), min_size=n, max_size=n),
        st.lists(st.booleans(), min_size=n, max_size=n),
    )
)


@given(OUTCOMES)
def test_split_of_words_agrees_with_all_sets_of_readings(drawn: Any) -> None:
    held, words, _, _ = map(np.array, drawn)
    everything = np.ones(len(held), dtype=bool)
    known = sorted(set(words))
    sets = [chosen for k in range(1, len(known)) for chosen in combinations(known, k)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "SIDE", 1)
        split = best_split(drawn[1], held, everything, everything)
    if not sets:
        assert split is None
        return
    assert split is not None
    best = max(explained_by(np.isin(words, chosen), held) for chosen in sets)
    assert split.found == pytest.approx(best, abs=1e-12)
    for values, holds, count in split.sides:
        chosen = np.isin(words, values)
        assert (count, holds) == (chosen.sum(), (chosen & held).sum())


@given(OUTCOMES)
def test_split_of_numbers_agrees_with_all_thresholds(drawn: Any) -> None:
    """Found in some samples and stated from the others, with two samples or more on each side."""
    held, _, numbers, found = map(np.array, drawn)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "SIDE", 2)
        split = best_split(drawn[2], held, found, ~found)
    sides = [
        numbers <= number
        for number in np.unique(numbers)
        if all((part & half).sum() >= 2 for part in (numbers <= number, numbers > number)
               for half in (found, ~found))
    ]  # fmt: skip
    if not sides:
        assert split is None
        return
    assert split is not None
    best = max(explained_by(side[found], held[found]) for side in sides)
    assert split.found == pytest.approx(best, abs=1e-12)
    low = numbers <= split.threshold
    assert explained_by(low[found], held[found]) == pytest.approx(best, abs=1e-12)
    assert split.explained == pytest.approx(explained_by(low[~found], held[~found]), abs=1e-12)
    counted = [((~found & part).sum(), (~found & part & held).sum()) for part in (low, ~low)]
    assert [(count, holds) for _, holds, count in split.sides] == counted


@given(st.floats(-1e12, 1e12), st.floats(-1e12, 1e12))
def test_printed_threshold_separates_the_same_samples(one: float, other: float) -> None:
    low, high = sorted((one, other))
    if low == high:
        return
    threshold = rounded(low, high)
    assert low <= threshold < high
    assert float(repr(threshold)) == threshold
    digits = len(f"{threshold:e}".partition("e")[0].strip("-0.").replace(".", ""))
    fewer = (float(f"{low + (high - low) / 2:.{k}g}") for k in range(1, digits))
    assert not any(low <= number < high for number in fewer)


@pytest.mark.parametrize(
    ("low", "high", "threshold"), [(2, 3, 2.0), (1050.0, 1099.0, 1070.0), (0.1, 0.3, 0.2)]
)
def test_threshold_has_few_digits(low: float, high: float, threshold: float) -> None:
    assert rounded(low, high) == threshold


def planted(n: int, seed: int, wrong: float = 0.1) -> tuple[Robustness, Robustness]:
    """Samples that a number decides, and the same that a word decides, but for a tenth."""
    stream = np.random.default_rng(seed)
    gain, word = stream.uniform(0, 2000, n), stream.choice(["x_y", "z", "w"], n)
    others = {f"n{k}": stream.random(n).tolist() for k in range(6)}
    noise = stream.random(n) < wrong
    columns = {"gain": gain.tolist(), "word": word.tolist(), **others}
    return samples((gain > 700) ^ noise, **columns), samples((word == "z") ^ noise, **columns)


@pytest.mark.parametrize("seed", range(10))
def test_planted_choice_is_found(seed: int) -> None:
    by_gain, by_word = map(separated, planted(120, seed))
    assert (by_gain.choice, by_word.choice) == ("a.gain", "a.word")
    assert next(iter(by_gain.splits)) == "a.gain"
    assert by_gain.explained is not None
    assert by_gain.explained > DECIDES
    threshold = by_gain.splits["a.gain"].threshold
    assert threshold is not None
    assert 600 <= threshold <= 800
    said = (
        r"holds with gain \(observer a\) above (\S+) 1/s in \d+ of \d+ samples, up to it in \d+ of"
    )
    assert re.match(said, by_gain.sentence)
    said = r"holds with z in \d+ of \d+ samples, with (x y or w|w or x y) in \d+ of \d+ \(choice: w"
    assert re.match(said, by_word.sentence)
    assert sum(count for _, _, count in by_word.splits["a.word"].sides) == 60  # of the other half


@pytest.mark.parametrize(("side", "n"), [(SIDE, 60), (SIDE, 200), (3, 30)])
def test_random_outcomes_are_separated_by_nothing(
    side: int, n: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where all samples find and state, few would name a choice more often than not."""
    monkeypatch.setattr(module, "SIDE", side)
    monkeypatch.setattr(module, "_HALVES", 5)
    stream = np.random.default_rng(0)
    named = {False: 0, True: 0}
    for _ in range(20):
        columns = {f"n{k}": stream.random(n).tolist() for k in range(8)}
        columns["word"] = stream.choice(list("abc"), n).tolist()
        held = stream.random(n) < 0.3
        for whole in named if n == 30 else (False,):
            named[whole] += bool(separated(samples(held, whole, **columns)).choice)
    assert named[False] <= (0 if side == SIDE else 3)
    assert n > 30 or named[True] >= 10


@pytest.mark.parametrize("words", range(2, 8))
@pytest.mark.parametrize("n", [40, 200, 1000])
def test_halves_have_equal_numbers_of_each_word(words: int, n: int) -> None:
    """Words come in blocks in the order of samples."""
    place = np.arange(n) % words
    for found in halves(n):
        assert found.sum() == n // 2
        each = np.array([(found & (place == word)).sum() for word in range(words)])
        assert np.abs(each - n / words / 2).max() <= 2 * np.sqrt(n / words)


def test_few_samples_tell_nothing() -> None:
    """A choice that decides all is not tried if a side has nine samples in one half."""
    found = np.arange(4 * SIDE) % 2 == 0
    held = np.arange(4 * SIDE) < 2 * SIDE
    split = best_split(held.astype(float).tolist(), held, found, ~found)
    assert split is not None
    assert split.explained == 1.0
    held[0] = False
    assert best_split(held.astype(float).tolist(), held, found, ~found) is None
    few = separated(samples(held[:20], gain=held[:20].astype(float).tolist()))
    assert few == module.Separation("", "20 samples are too few to tell which choice decides")


def test_more_samples_do_not_change_the_choice(monkeypatch: pytest.MonkeyPatch) -> None:
    """One random half would find the choice sometimes only."""
    by_gain, _ = planted(130, 7, wrong=0.2)
    named = {1: 0, 15: 0}
    for n in range(110, 130):
        fewer = Robustness(by_gain.names, by_gain.trials[:n])
        for many in named:
            monkeypatch.setattr(module, "_HALVES", many)
            named[many] += separated(fewer).choice == "a.gain"
    assert named[1] < 18
    assert named[15] == 20


def test_samples_that_are_no_case_are_not_split() -> None:
    drawn, _ = planted(130, 7, wrong=0.2)
    words = drawn.outcomes(claim())
    trials = [one for trial in drawn.trials for one in (drawn.trials[0], trial)]
    mixed = [one for word in words for one in ("no case", word)]
    more = separation(claim(), Robustness(drawn.names, trials), mixed)
    assert more == separation(claim(), drawn, words)


def test_all_settings_are_found_in_and_stated() -> None:
    held = [True] * 10 + [False] * 10
    found = separated(samples(held, whole=True, word=["x"] * 10 + ["y"] * 10))
    said = "holds with x in 10 of 10 settings, with y in 0 of 10 (choice: word of observer a)"
    assert found.sentence == said
    four = separated(samples([True, False] * 2, whole=True, word=["x", "x", "y", "y"]))
    assert four.sentence == "4 settings are too few to tell which choice decides"


def test_seeds_and_constant_choices_are_not_tried() -> None:
    held = np.arange(80) % 2 == 0
    columns = {"seed": held.tolist(), "random_seed": held.astype(int).tolist(), "word": ["x"] * 80}
    found = separated(samples(held, **columns))
    assert found == module.Separation("", "no single choice decides")
    nothing = module.Separation("", "0 samples are too few to tell which choice decides")
    assert separated(Robustness(("a.gain",))) == nothing


@pytest.mark.parametrize(
    ("values", "threshold", "label", "said"),
    [
        ((["a_b", "c"], ["d"]), None, Label("word", "observer a", readings={"a_b": "a b"}),
         "holds with d in 9 of 10 samples, with a b or c in 1 of 12 (choice: word of observer a)"),
        (([], []), 0.9, Label("K1", "observer a", notes={"1": "named by the paper"}),
         "holds with K1 (observer a) above 0.9 (1 is named by the paper) in 9 of 10 samples, up to"
         " it in 1 of 12"),
        (([], []), 20000.0, Label("gain", "", "1/s", notes={"3": "stated by the paper"}),
         "holds with gain above 20000 1/s in 9 of 10 samples, up to it (3 is stated by the paper)"
         " in 1 of 12"),
    ],
)  # fmt: skip
def test_sides_are_put_into_words(
    values: tuple[list[str], list[str]], threshold: float | None, label: Label, said: str
) -> None:
    sides = ((values[0], 1, 12), (values[1], 9, 10))
    assert in_words(Split(0.9, 0.8, threshold, sides), label) == said


def test_any_form_depends_on_the_criterion() -> None:
    """The samples of the repository: it holds with minimum gamma, and seldom with minimum norm."""
    seed = read_yaml(ROOT / "config/config.yaml")["seed"]
    parameters = Parameters.load(ROOT, "eso", seed=seed)
    claims = read_registry(ROOT, parameters).claims
    one = next(each for each in claims if each.name == "any_form")
    cached = read_robustness(ROOT / samples_path("eso"), parameters, [one])[one.name]
    found = separation(one, cached, cached.outcomes(one))
    assert found.choice == "designs.{pd_pi,pi_optimal}.criterion"
    said = (
        r"holds with minimum gamma in (\d+) of (\d+) samples, with minimum norm in (\d+) of (\d+)"
        r" \(choice: criterion of designs pd pi, pi optimal\)"
    )
    counts = re.fullmatch(said, found.sentence)
    assert counts
    held, samples, others, rest = map(int, counts.groups())
    assert samples + rest == cached.samples // 2
    assert held > 0.9 * samples
    assert others < 0.3 * rest


def test_bars_begin_with_the_choice_that_separates() -> None:
    by_gain, by_word = planted(120, 1)
    claims = [claim("one"), claim("two"), claim("three")]
    sampled = {"one": by_gain, "two": by_word, "three": by_gain}
    verdicts = {"one": DEPENDS, "two": UNDECIDED, "three": REPRODUCED}
    (axes,) = sensitivity_bars(claims, sampled, verdicts).axes
    titles = [text.get_text().replace("\n", " ") for text in axes.texts]
    assert titles == [
        f"one: {separated(by_gain).sentence}",
        f"two: {separated(by_word).sentence}",
    ]
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert (labels[0], labels[len(labels) // 2]) == ("gain", "word")
    bars = [(bar.get_width(), bar.get_facecolor()[0]) for bar in axes.patches]
    splits = separated(by_gain).splits
    assert [width for width, _ in bars[: len(bars) // 2]] == [
        split.explained for split in list(splits.values())[: len(bars) // 2]
    ]
    assert [k for k, (_, shade) in enumerate(bars) if shade < 0.5] == [0, len(bars) // 2]


def test_empty_sensitivity_figure_states_the_reason() -> None:
    (text,) = sensitivity_bars([claim()], {}, {"it_is_small": REPRODUCED}).texts
    assert text.get_text().startswith("No ")
