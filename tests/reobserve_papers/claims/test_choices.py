"""Choices: what may be sampled and changed, in which range and steps."""

from __future__ import annotations

import copy
import math
import random
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from reobserve.core.errors import InputError
from reobserve_papers.claims.choices import (
    Choice,
    Knob,
    cells,
    chosen,
    find_choice,
    with_values,
)
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

ILO = Parameters.load(ROOT, "ilo", seed=1)
GAIN = "observers.sampled.K2"


def parameters(**entries: dict[str, Any]) -> Parameters:
    """The parameter file of `ilo` with entries of its plant replaced."""
    tree = copy.deepcopy(ILO.tree)
    for name, parts in entries.items():
        tree["plant"][name] = {"unit": "1", "source": "assumed", "why": "so", **parts}
    return Parameters("ilo", tree, 1)


def sample(start: Parameters, choice: Choice, number: int) -> Parameters:
    """The parameters of a sample of one choice."""
    return with_values(start, [choice], chosen(start, [choice], number))


def values(start: Parameters, pattern: str, count: int = 4000) -> np.ndarray:
    """The samples of a choice."""
    choice = find_choice(start, pattern)
    key = choice.keys[0].split(".")
    return np.array([sample(start, choice, k).section(*key[:-1])[key[-1]] for k in range(count)])


def test_magnitude_is_sampled_log_uniformly() -> None:
    drawn = values(ILO, GAIN)  # 500 to 5000: a decade
    assert drawn.min() >= 500
    assert drawn.max() <= 5000
    share = np.mean(drawn < 1000)
    assert abs(share - math.log10(2)) < 4 * math.sqrt(0.21 / len(drawn))


def test_sampled_number_is_integer_only_if_value_and_range_are() -> None:
    assert Knob(("a",), (), 2, (1, 4)).at(0.6) == 3
    assert Knob(("a",), (), 2, (1, 3.5)).at(0.6) == pytest.approx(2.5)
    assert Knob(("a",), (), 2.0, (1, 3)).at(0.7) == pytest.approx(2.4)


def test_narrow_range_is_sampled_uniformly() -> None:
    drawn = values(parameters(mass={"value": 2.0, "range": [1.0, 5.0]}), "plant.mass")
    assert abs(np.mean(drawn) - 3.0) < 4 * (4 / math.sqrt(12)) / math.sqrt(len(drawn))
    assert abs(np.mean(drawn < 2.0) - 0.25) < 4 * math.sqrt(0.19 / len(drawn))


def test_vector_entries_are_sampled_by_their_patterns() -> None:
    start = parameters(noise={"value": [1.0, 2.0, 3.0], "range": {"0": [0, 1], "2": [3.0, 3.5]}})
    drawn = values(start, "plant.noise", 200)
    assert np.all((drawn[:, 0] >= 0) & (drawn[:, 0] <= 1))
    assert np.all(drawn[:, 1] == 2.0)
    assert np.all((drawn[:, 2] >= 3) & (drawn[:, 2] <= 3.5))
    assert np.ptp(drawn[:, 2]) > 0.4


def test_overlapping_patterns_allow_only_common_values() -> None:
    spans = {"*.size": [0.0, 1.0], "0.size": [0.25, 2.0]}
    start = parameters(fault={"value": [{"kind": "constant", "size": 0.5}], "range": spans})
    (knob,) = find_choice(start, "plant.fault").knobs
    assert (knob.name, knob.span) == ("plant.fault.0.size", (0.25, 1.0))


def test_sampled_integers_stay_integers_and_words_stay_words() -> None:
    start = parameters(order={"value": 2, "range": [1, 400]}, solver=TWO_WORDS)
    drawn = values(start, "plant.order", 400)
    assert drawn.dtype == int
    both = [find_choice(start, "plant.solver"), find_choice(start, "plant.order")]
    words = np.array([chosen(start, both, k)[0] for k in range(400)])
    assert abs(np.mean(words == "A") - 0.5) < 0.1


TWO_WORDS = {"value": "A", "range": {"choices": ["A", "B"]}}


def all_cells(start: Parameters, *patterns: str) -> list[tuple[Any, ...]] | None:
    return cells([find_choice(start, pattern) for pattern in patterns])


def test_words_and_small_whole_numbers_are_counted() -> None:
    start = parameters(order={"value": 2, "range": [1, 4]}, solver=TWO_WORDS)
    counted = all_cells(start, "plant.order", "plant.solver")
    assert counted == [(order, word) for order in (1, 2, 3, 4) for word in ("A", "B")]
    choices = [find_choice(start, "plant.order"), find_choice(start, "plant.solver")]
    drawn = [with_values(start, choices, chosen(start, choices, k)) for k in range(8)]
    plants = [one.section("plant") for one in drawn]
    assert [(plant["order"], plant["solver"]) for plant in plants] == counted


@pytest.mark.parametrize(
    ("entry", "count"),
    [
        ({"value": 2, "range": [1, 64]}, 64),
        ({"value": 2, "range": [1, 65]}, None),
        ({"value": 2, "range": [1.0, 4.0]}, None),
        ({"value": 2, "range": [2, 8], "multiple_of": 2}, None),
        ({"value": "A", "range": {"choices": list("ABC")}, "named": ["B"]}, 3),
        ({"value": [1, 2], "range": {"*": [1, 4]}}, 16),
    ],
)
def test_what_is_counted_is_few_and_discrete(entry: dict[str, Any], count: int | None) -> None:
    counted = all_cells(parameters(order=entry), "plant.order")
    assert (counted and len(counted)) == count


def test_more_than_64_combinations_and_random_seeds_are_sampled() -> None:
    start = parameters(order={"value": 2, "range": [1, 33]}, solver=TWO_WORDS)
    assert all_cells(start, "plant.order", "plant.solver") is None
    assert all_cells(start, "plant.solver", "seed") is None
    assert all_cells(start, "plant.solver", GAIN) is None
    assert cells([]) is None


def test_samples_lie_on_the_required_grid() -> None:
    start = parameters(hold={"value": 0.3, "range": [0.05, 1.0], "multiple_of": 0.1})
    drawn = values(start, "plant.hold", 400)
    grid = {0.05} | {round(0.1 * k, 1) for k in range(1, 11)}  # the ends are always allowed
    assert set(drawn.tolist()) <= grid
    assert 0.3 in drawn  # not 0.30000000000000004
    start = parameters(
        noise={"value": [1.0, 2.0], "range": {"*": [0.0, 9.0]}, "multiple_of": {"1": 0.5}}
    )
    drawn = values(start, "plant.noise", 100)
    assert np.all(drawn[:, 1] * 2 == np.round(drawn[:, 1] * 2))
    assert not np.all(drawn[:, 0] * 2 == np.round(drawn[:, 0] * 2))


def test_pattern_moves_its_keys_together() -> None:
    choice = find_choice(ILO, "observers.*.K2")
    assert len(choice.keys) == 3
    assert choice.knobs[0].name == "observers.{sampled,continuous,forgetting}.K2"
    assert len(chosen(ILO, [choice], 2)) == len(choice.names) == 1
    drawn = sample(ILO, choice, 2)
    gains = {drawn.section("observers", name)["K2"] for name in ("sampled", "continuous")}
    assert len(gains) == 1
    assert gains != {2000.0}
    assert ILO.section("observers", "sampled")["K2"] == 5000.0  # unchanged


def test_seed_can_be_sampled() -> None:
    choice = find_choice(ILO, "seed")
    assert choice.names == ("seed",)
    seeds = {sample(ILO, choice, k).seed for k in range(5)}
    assert seeds == {chosen(ILO, [choice], k)[0] for k in range(5)}
    assert len(seeds) == 5


def test_range_position_maps_to_its_value() -> None:
    (knob,) = find_choice(ILO, GAIN).knobs
    assert knob.place(500) == 0
    assert knob.place(5000) == pytest.approx(1)
    assert knob.place(500 * math.sqrt(10)) == pytest.approx(0.5)
    for place in (0.0, 0.3, 1.0):
        assert knob.place(knob.at(place)) == pytest.approx(place)
    assert knob.place(1e9) == pytest.approx(1)  # an override from outside the range
    moved = with_values(ILO, [find_choice(ILO, GAIN)], [700.0])
    assert moved.section("observers", "sampled")["K2"] == 700.0
    assert moved.section("observers", "continuous")["K2"] == 2000.0


@pytest.mark.parametrize(
    ("pattern", "said"),
    [
        (
            "observers.sampled.K3",
            "depends_on: there is no 'observers.sampled.K3'; did you mean 'observers.sampled.K2'?",
        ),
        (
            "plant.inertia",
            "depends_on: plant.inertia is stated (Section 4, (19)), no choice",
        ),
        ("plant.step", "depends_on: plant.step is a numerical resolution, no choice"),
    ],
)
def test_invalid_choice_is_reported_in_one_sentence(pattern: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        find_choice(ILO, pattern)
    assert str(caught.value) == said


def test_rounding_to_the_grid_stays_within_the_range() -> None:
    """The ends 0.16 and 0.98 round to 0.2 and, were it inside, to 1.0."""
    start = parameters(spacing={"value": 0.5, "range": [0.16, 0.98], "multiple_of": 0.1})
    (knob,) = find_choice(start, "plant.spacing").knobs
    assert [knob.at(place) for place in (0.0, 0.5, 1.0)] == [0.2, 0.6, 0.98]


def test_half_of_the_samples_take_a_value_named_in_the_paper() -> None:
    drawn = values(
        parameters(mass={"value": 2.0, "range": [1.0, 5.0], "named": [1.0]}), "plant.mass"
    )
    assert abs(np.mean(drawn == 1.0) - 0.5) < 4 * 0.5 / math.sqrt(len(drawn))
    others = drawn[drawn != 1.0]
    assert abs(np.mean(others) - 3.0) < 4 * (4 / math.sqrt(12)) / math.sqrt(len(others))
    (knob,) = find_choice(ILO, GAIN).knobs
    assert "named" not in repr(knob)  # digests of cached samples depend on this


NUMBER = find_choice(ILO, GAIN)  # with it, words are not counted
letters = st.lists(st.text("abc", max_size=4), min_size=1, max_size=15, unique=True)


@given(letters, st.lists(st.text("ab"), max_size=1), st.integers(0, 60), st.integers(0, 2**64))
@example(["sampled", "continuous", "forgetting"], [], 20, 1)
@example(["series", "jacobian", "composed"], ["series"], 200, 1)
def test_each_word_comes_in_as_many_samples(
    words: list[str], named: list[str], count: int, seed: int
) -> None:
    """In every block, and nearly so in samples that end within one."""
    start = parameters(solver={"value": words[0], "range": {"choices": words}, "named": named})
    start = replace(start, seed=seed)
    choice = find_choice(start, "plant.solver")
    drawn = [chosen(start, [choice, NUMBER], number)[0] for number in range(count)]
    (knob,) = choice.knobs
    assert knob.block % len(words) == 0
    assert knob.block < 12 + len(words)
    for first in range(0, count, knob.block):
        counts = Counter(drawn[first : first + knob.block])
        assert max(counts.values()) <= knob.block // len(words)
        if first + knob.block <= count:
            assert counts == dict.fromkeys(words, knob.block // len(words))


def test_words_have_other_orders_in_other_blocks_choices_and_seeds() -> None:
    start = parameters(a=TWO_WORDS, b=TWO_WORDS)
    choices = [find_choice(start, f"plant.{name}") for name in "ab"]

    def orders(seed: int) -> set[str]:
        rows = [chosen(replace(start, seed=seed), [*choices, NUMBER], k) for k in range(60)]
        return {
            "".join(row[j] for row in rows)[k : k + 12] for j in (0, 1) for k in range(0, 60, 12)
        }

    assert len(orders(1)) == 10
    assert not orders(1) & orders(2)


ASKED = ["seed", "observers.*.K2", "observers.forgetting.K1", "metrics.variant", *(
    f"plant.{name}" for name in ("solver", "order", "hold", "noise", "mass")
)]  # fmt: skip


@given(st.lists(st.sampled_from(ASKED), unique=True), st.integers(0, 10**6), st.randoms())
@example(["metrics.variant"], 17, random.Random(1))
def test_choice_is_the_same_whichever_others_are_asked(
    asked: list[str], number: int, order: random.Random
) -> None:
    start = parameters(
        solver={"value": "A", "range": {"choices": ["A", "B", "C"]}, "named": ["B"]},
        order={"value": 2, "range": [1, 400]},
        hold={"value": 0.3, "range": [0.05, 1.0], "multiple_of": 0.1},
        noise={"value": [1.0, 2.0], "range": {"*": [0.0, 9.0]}},
        mass={"value": 2.0, "range": [1.0, 5.0], "named": [1.0, 3.0]},
    )

    def found(patterns: list[str]) -> dict[str, Any]:
        choices = [find_choice(start, pattern) for pattern in patterns]
        names = [name for choice in choices for name in choice.names]
        return dict(zip(names, chosen(start, choices, number), strict=True))

    everything = found([*ASKED, GAIN])
    few = found(order.sample([*asked, GAIN], len(asked) + 1))
    assert few.items() <= everything.items()
