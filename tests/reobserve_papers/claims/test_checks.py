"""Checks of claims: what they look up, compute, accept, refuse and report."""

from __future__ import annotations

import math
from typing import Any

import pytest

from reobserve.core.errors import InputError
from reobserve_papers.claims.checks import Check, Reference
from reobserve_papers.claims.outcomes import Outcome, outcome
from reobserve_papers.claims.registry import Claim

NUMBERS = {
    "fig1": {("a", "error"): 0.02, ("b", "error"): 0.1, ("b", "delay"): math.nan},
    "theory": {("bound", "gap"): -3.0, ("bound", "none"): 0.0},
}


def check(**body: Any) -> Check:
    return Check.parse(body)


@pytest.mark.parametrize(
    ("body", "holds"),
    [
        ({"value": "fig1 a error", "below": 0.03}, True),
        ({"value": "fig1 a error", "below": 0.02}, False),  # strictly
        ({"value": "fig1 a error", "above": 0.02}, False),
        ({"value": "fig1 b error", "above": 0.02}, True),
        ({"value": "theory bound gap", "within": [-3, -2]}, True),  # closed
        ({"value": "theory bound gap", "within": [-2, 0]}, False),
        ({"value": "fig1 a error", "over": "fig1 b error", "below": 0.21}, True),
        ({"value": "fig1 a error", "over": "fig1 b error", "below": 0.19}, False),
        ({"value": "fig1 b error", "minus": "fig1 a error", "within": [0.0799, 0.0801]}, True),
        ({"value": "fig1 b delay", "below": 1e9}, False),
        ({"value": "fig1 b delay", "above": -1e9}, False),
        ({"value": "fig1 b delay", "exists": False}, True),
        ({"value": "fig1 b delay", "exists": True}, False),
        ({"value": "fig1 a error", "exists": True}, True),
        ({"value": ["fig1 a error", "fig1 b error"], "below": 0.05}, False),
        ({"value": ["fig1 a error", "fig1 b error"], "below": 0.05, "share": 0.5}, True),
        ({"value": ["fig1 a error", "fig1 b error"], "rising": True}, True),
        ({"value": ["fig1 a error", "fig1 b error"], "falling": True}, False),
        ({"value": ["fig1 a error", "fig1 a error"], "rising": True}, False),  # strictly
        ({"value": ["fig1 a error", "fig1 b delay"], "rising": True}, False),
        ({"value": "fig1 a error", "over": "theory bound none", "above": 1e300}, True),  # inf
        ({"value": "theory bound none", "over": "theory bound none", "below": 1}, False),  # nan
    ],
)  # fmt: skip
def test_check_holds_as_computed_by_hand(body: dict[str, Any], holds: bool) -> None:
    asked = check(**body)
    assert asked.holds(NUMBERS) is holds
    # A single number is as good as all of them.
    assert asked.satisfied_by(asked.deciding(NUMBERS)) is holds


def test_study_number_is_selected_by_its_coordinates() -> None:
    numbers = {"fig1": {("a", "error gain=2 noise=1e-05"): 0.5}}
    for text in ("error gain=2 noise=1e-05", "error noise=1.0e-5 gain=2.0"):
        one = check(value=f"fig1 a {text}", below=1)
        assert one.values(numbers) == [0.5]
        assert one.measured(numbers) == "fig1 a error gain=2 noise=1e-05 = 0.5, must be below 1"


def test_single_reference_applies_to_a_whole_list() -> None:
    both = check(value=["fig1 a error", "fig1 b error"], over="fig1 b error", within=[0.2, 1])
    assert both.values(NUMBERS) == pytest.approx([0.2, 1.0])
    assert both.references == (
        Reference("fig1", "a", "error"),
        *(Reference("fig1", "b", "error"),) * 3,
    )


def test_check_reports_the_number_and_the_condition() -> None:
    one = check(value="fig1 a error", below=0.03)
    assert one.measured(NUMBERS) == "fig1 a error = 0.02, must be below 0.03"
    ratio = check(value="fig1 a error", over="fig1 b error", above=1)
    assert ratio.measured(NUMBERS) == "fig1 a error / fig1 b error = 0.2, must be above 1"
    listed = check(value=["fig1 a error", "fig1 b error"], below=0.05, share=0.5)
    assert listed.measured(NUMBERS) == (
        "fig1 a error and so on: 1 of 2 are below 0.05, for at least 50%; the worst is 0.1"
    )
    assert (
        check(value="fig1 b delay", exists=False).measured(NUMBERS)
        == "fig1 b delay = nan, must be nan"
    )
    row = check(value=["fig1 a error", "fig1 b error"], falling=True)
    assert row.measured(NUMBERS) == "fig1 a error = 0.02, 0.1: must be falling"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("fig2 a error", "figure: there is no 'fig2'; did you mean 'fig1'?"),
        ("fig1 c error", "observer: fig1 has no 'c'; there are: a, b"),
        ("fig1 a errors", "metric: fig1 has no 'errors' of a; did you mean 'error'?"),
        ("fig1 a delay", "metric: fig1 has no 'delay' of a; there are: error"),
    ],
)
def test_unknown_number_is_reported_in_one_sentence(text: str, said: str) -> None:
    with pytest.raises(InputError) as caught:
        check(value=text, below=1).holds(NUMBERS)
    assert str(caught.value) == said


@pytest.mark.parametrize(
    ("body", "said"),
    [
        *(
            (
                {"value": text, "below": 1},
                f"reference: {text!r} must be FIGURE OBSERVER METRIC, then NAME=LEVEL for a "
                "coordinate",
            )
            for text in ("fig1 a", "fig1 a b c", "fig1 a order=4", "fig1 a b order=")
        ),
        (
            {"value": "fig1 a error"},
            ": 0 relations given, must be one of below, above, within, exists, falling, rising",
        ),
        (
            {"value": "fig1 a error", "below": 1, "above": 0},
            ": 2 relations given, must be one of below, above, within, exists, falling, rising",
        ),
        (
            {"value": "fig1 a error", "over": "fig1 b error", "minus": "fig1 b error", "below": 1},
            ": has both over and minus, must have one of them",
        ),
        (
            {"value": ["fig1 a error"] * 3, "over": ["fig1 b error"] * 2, "below": 1},
            "over: has 2 references, must have 3 or 1",
        ),
        (
            {"value": "fig1 a error", "rising": True},
            "rising: asks for a list of two references or more",
        ),
    ],
)
def test_invalid_check_is_reported_in_one_sentence(body: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as caught:
        Check.parse(body)
    assert str(caught.value) == said


@pytest.mark.parametrize(
    ("bound", "relation", "worst"),
    [([1, 3], "within", "3.5"), (2, "below", "3.5"), (2, "above", "1.2")],
)
def test_worst_of_a_list_is_farthest_from_the_condition(
    bound: Any, relation: str, worst: str
) -> None:
    """3.5 is 1.5 off the middle of 1 and 3, and 1.2 is 0.8 off."""
    numbers = {"f": {("a", "x"): 1.2, ("b", "x"): 3.5, ("c", "x"): 2.1}}
    one = check(value=["f a x", "f b x", "f c x"], **{relation: bound})
    assert one.measured(numbers).endswith(f"the worst is {worst}")


A, B = "fig1 a error", "fig1 b error"


@pytest.mark.parametrize(
    ("body", "mirror"),
    [
        ({"value": A, "over": B, "below": 0.95}, {"value": B, "over": A, "below": 0.95}),
        ({"value": A, "over": B, "below": 1}, {"value": B, "over": A, "below": 1}),
        ({"value": A, "over": B, "above": 2}, {"value": B, "over": A, "above": 2}),
        ({"value": A, "minus": B, "below": 0}, {"value": B, "minus": A, "below": 0}),
        ({"value": A, "minus": B, "above": 0.1}, {"value": B, "minus": A, "above": 0.1}),
        (
            {"value": [A, "fig1 b delay"], "over": B, "below": 0.9, "share": 0.5},
            {"value": [B, B], "over": [A, "fig1 b delay"], "below": 0.9, "share": 0.5},
        ),
        # Tolerates the opposite.
        ({"value": A, "over": B, "below": 1.1}, None),
        ({"value": A, "over": B, "above": 0.9}, None),
        ({"value": A, "minus": B, "below": 0.1}, None),
        ({"value": A, "minus": B, "above": -0.1}, None),
        # Says not which of two is less.
        ({"value": A, "below": 0.95}, None),
        ({"value": A, "over": B, "within": [0, 0.5]}, None),
        ({"value": A, "over": B, "exists": True}, None),
        ({"value": [A, B], "falling": True}, None),
        ({"value": [A, B], "minus": B, "rising": True}, None),
    ],
)
def test_mirror_says_the_opposite_of_which_is_less(
    body: dict[str, Any], mirror: dict[str, Any] | None
) -> None:
    mirrored = check(**body).mirrored
    assert mirrored == (mirror and check(**mirror))
    assert mirrored is None or mirrored.mirrored == check(**body)


LESS = {"value": A, "over": B, "below": 0.95}


def of(checks: list[dict[str, Any]], a: float, b: float) -> Outcome:
    """The outcome with these two errors."""
    claim = Claim("ilo", "it", checks=tuple(check(**one) for one in checks))
    return outcome(claim, {"fig1": {("a", "error"): a, ("b", "error"): b}})


@pytest.mark.parametrize(
    ("a", "b", "found"),
    [
        (0.9, 1.0, "holds"),
        (0.96, 1.0, "tie"),
        (1.0, 0.96, "tie"),
        (1.0, 0.9, "opposed"),
        (math.nan, 1.0, "tie"),  # neither is less
        (0.0, 0.0, "tie"),
        (1.0, math.nan, "no case"),
        (math.nan, math.nan, "no case"),
    ],
)
def test_outcome_is_held_tied_or_opposed(a: float, b: float, found: Outcome) -> None:
    assert of([LESS], a, b) == found


def test_outcome_without_a_mirror_is_never_tied() -> None:
    small = {"value": A, "below": 0.5}
    assert [of([small], a, 1.0) for a in (0.4, 0.6)] == ["holds", "opposed"]


def test_outcome_of_several_checks_is_opposed_where_all_opposites_hold() -> None:
    """A check without a mirror is the same in the opposite of the claim."""
    small = {"value": A, "below": 5.0}
    assert of([LESS, small], 1.0, 2.0) == "holds"
    assert of([LESS, small], 2.0, 1.0) == "opposed"
    assert of([LESS, small], 6.0, 1.0) == "tie"
    assert of([LESS, small], 6.0, 9.0) == "tie"


def test_outcome_without_a_figure_is_lost() -> None:
    claim = Claim("ilo", "it", checks=(check(**LESS),))
    assert (outcome(claim, None), outcome(claim, {})) == ("refused", "diverged")


def test_numbers_that_are_not_divided_by_may_be_none() -> None:
    """An event that never happens is none."""
    assert of([{"value": A, "minus": B, "below": 0.0}], 1.0, math.nan) == "tie"
    assert of([{"value": A, "exists": False}], math.nan, 1.0) == "holds"


def test_every_outcome_is_one_of_six() -> None:
    """So that those of samples add up to all of them."""
    values = (-1.0, 0.0, 0.5, 1.0, math.nan, math.inf)
    found = [of([LESS], a, b) for a in values for b in values]
    kinds: tuple[Outcome, ...] = ("holds", "tie", "opposed", "diverged", "refused", "no case")
    assert sum(found.count(kind) for kind in kinds) == len(found) == 36
    assert {"holds", "tie", "opposed", "no case"} == set(found)


def test_null_is_the_same_check_of_another_observer() -> None:
    one = check(value=[A, B], over=B, below=0.9).of_others({"b": "idle"})
    assert one == check(value=[A, "fig1 idle error"], over="fig1 idle error", below=0.9)
