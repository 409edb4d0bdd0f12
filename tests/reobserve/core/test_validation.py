"""Values checked against types: every error is one sentence with the dotted key."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from pydantic import Field, Tag

from reobserve.core.errors import InputError
from reobserve.core.matrices import FloatArray, as_positive
from reobserve.core.validation import (
    Count,
    Names,
    NotNegative,
    Positive,
    Share,
    Window,
    array,
    checked,
    having,
    items,
    matrix,
    parse,
    positive_definite,
    schema,
    vector,
    within,
)


@dataclass(frozen=True)
class Plant:
    step: Positive
    noise: NotNegative
    start: Annotated[list[float], vector(3)]
    runs: Count = 1


@dataclass(frozen=True)
class Kalman:
    algorithm: Literal["kalman"]
    stay: Share


@dataclass(frozen=True)
class SlidingMode:
    algorithm: Literal["sliding", "relay"]
    layer: Positive
    smooth: bool = False


@dataclass(frozen=True)
class Whole:
    plant: Plant
    observers: Mapping[str, Annotated[Kalman | SlidingMode, Field(discriminator="algorithm")]]


PLANT = {"step": 0.5, "noise": 0, "start": [1, 2.5, 3]}
TREE = {
    "plant": PLANT,
    "observers": {
        "a": {"algorithm": "kalman", "stay": 0.9},
        "b": {"algorithm": "relay", "layer": 2},
    },
}


def test_tree_is_parsed_into_types_and_keeps_its_values() -> None:
    found = parse(Whole, TREE)
    assert found == Whole(
        Plant(0.5, 0, [1, 2.5, 3]), {"a": Kalman("kalman", 0.9), "b": SlidingMode("relay", 2)}
    )
    assert found.plant.runs == 1


def changed(*path: str, **values: Any) -> dict[str, Any]:
    """The tree with some keys of one branch changed; None removes a key."""
    tree: dict[str, Any] = {"plant": {**PLANT}, "observers": {}}
    tree["observers"] = {name: {**body} for name, body in TREE["observers"].items()}
    branch: Any = tree
    for key in path:
        branch = branch[key]
    branch.update(values)
    for key in [key for key, value in values.items() if value is None]:
        del branch[key]
    return tree


BAD: dict[str, tuple[Any, str]] = {
    "no mapping": (3, "x: 3 must be a mapping of keys to values"),
    "a section missing": ({"plant": PLANT}, "x.observers: is missing; the whole needs it"),
    "a key missing": (changed("plant", step=None), "x.plant.step: is missing; the plant needs it"),
    "a key misspelt": (
        changed("plant", stepp=1),
        "x.plant.stepp: unknown key; did you mean 'step'?",
    ),
    "a key of a form missing": (
        changed("observers", "a", stay=None),
        "x.observers.a.stay: is missing; the algorithm kalman needs it",
    ),
    "a key of another form": (
        changed("observers", "a", layer=1),
        "x.observers.a.layer: unknown key; there are: algorithm, stay",
    ),
    "no form": (
        changed("observers", "a", algorithm=None),
        "x.observers.a.algorithm: is missing, must be one of kalman, relay, sliding",
    ),
    "an unknown form": (
        changed("observers", "a", algorithm="kalmann"),
        "x.observers.a.algorithm: 'kalmann' must be one of kalman, sliding, relay",
    ),
    "a form that is no word": (
        changed("observers", "a", algorithm=[]),
        "x.observers.a.algorithm: [] must be one of kalman, sliding, relay",
    ),
    "a branch that is none": (
        changed("observers", a=[1]),
        "x.observers.a: [1] must be a mapping of keys to values",
    ),
    "a word": (changed("plant", step="x"), "x.plant.step: 'x' is not a number"),
    "true": (changed("plant", step=True), "x.plant.step: True is not a number"),
    "not a number": (
        changed("plant", step=float("nan")),
        "x.plant.step: nan must be a finite number",
    ),
    "endless": (changed("plant", step=float("inf")), "x.plant.step: inf must be a finite number"),
    "a whole number beyond all": (
        changed("plant", runs=2**64),
        "x.plant.runs: 18446744073709551616",
    ),
    "zero": (changed("plant", step=0), "x.plant.step: 0 must be greater than zero"),
    "negative": (changed("plant", noise=-1), "x.plant.noise: -1 must not be negative"),
    "half": (changed("plant", runs=0.5), "x.plant.runs: 0.5 must be a whole number"),
    "none": (changed("plant", runs=0), "x.plant.runs: 0 must be 1 or more"),
    "one": (changed("observers", "a", stay=1), "x.observers.a.stay: 1 must be less than 1"),
    "no list": (changed("plant", start=1), "x.plant.start: 1 must be a list of numbers"),
    "a short list": (
        changed("plant", start=[1, 2]),
        "x.plant.start: has shape (2,), must be a list of 3 numbers",
    ),
    "a word in a list": (
        changed("plant", start=[1, "y", 3]),
        "x.plant.start.1: 'y' is not a number",
    ),
    "a word for a truth": (
        changed("observers", "b", smooth="yes"),
        "x.observers.b.smooth: 'yes' must be one of true and false",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_invalid_value_is_reported_with_its_key(case: str) -> None:
    tree, said = BAD[case]
    with pytest.raises(InputError) as caught:
        parse(Whole, tree, "x")
    assert str(caught.value).startswith(said)


CONDITIONS: dict[str, tuple[Any, Any, str]] = {
    "an empty list": (Names, [], "x: has 0 items, must have 1 or more"),
    "a list too long": (Names, ["a"] * 10_001, "x: has 10001 items"),
    "named twice": (Names, ["a", "b", "a"], "x: ['a', 'b', 'a'] must not name anything twice"),
    "a window that falls": (Window, [2, 1], "x: [2, 1] must be 0 or more, rising"),
    "a window before zero": (Window, [-1, 1], "x: [-1, 1] must be 0 or more, rising"),
    "beyond an end": (Annotated[int, within(0, 5)], 6, "x: 6 must be 5 or less"),
    "too many": (
        Annotated[list[float], items(1, 2)],
        [1, 2, 3],
        "x: has 3 items, must have 2 or fewer",
    ),
    "another shape": (Annotated[Any, array(2, 1)], [1, 2], "x: has shape (2,), must be (2, 1)"),
    "no matrix": (Annotated[Any, matrix(2)], [1, 2, 3], "x: has shape (3,), must be one number"),
    "refused by a function": (Annotated[Any, checked(as_positive)], -1, "x: -1 must be greater"),
    "indefinite": (Annotated[Any, positive_definite(2)], [1, -1], "x: must be positive definite"),
}


@pytest.mark.parametrize("case", CONDITIONS)
def test_failed_condition_reports_what_is_allowed(case: str) -> None:
    kind, value, said = CONDITIONS[case]
    with pytest.raises(InputError) as caught:
        parse(kind, value, "x")
    assert str(caught.value).startswith(said)


def test_conditions_accept_valid_values() -> None:
    for kind, value in (
        (Names, ["a", "b"]),
        (Window, [0, 1e-9]),
        (Annotated[int, within(0, 5)], 5),
        (Annotated[Any, array(2, 1)], [[1], [2]]),
        (Annotated[Any, matrix(2)], 3),
        (Annotated[Any, checked(as_positive)], 3),
        (float | None, None),
        (float | str, "1/3"),
    ):
        assert parse(kind, value) == value


def test_message_for_a_single_allowed_word_omits_one_of() -> None:
    with pytest.raises(InputError, match=r"^x: 'relay' must be kalman$"):
        parse(Literal["kalman"], "relay", "x")
    with pytest.raises(InputError, match=r"^x: 'relay' must be one of kalman, sliding$"):
        parse(Literal["kalman", "sliding"], "relay", "x")


def test_quoted_values_are_shortened() -> None:
    with pytest.raises(InputError) as caught:
        parse(Plant, {**PLANT, "step": "y" * 20_000})
    assert len(str(caught.value)) < 300
    with pytest.raises(InputError) as caught:
        parse(Plant, {**PLANT, "y" * 20_000: 1})
    assert len(str(caught.value)) < 800


@dataclass(frozen=True)
class Long:
    first: int
    second: int


@dataclass(frozen=True)
class Short:
    first: int
    note: str = ""


Form = Annotated[
    Annotated[Long, Tag("long form")] | Annotated[Short, Tag("short form")],
    having({"second": "long form"}, "short form"),
]


def test_union_members_are_distinguished_by_a_key() -> None:
    assert parse(Form, {"first": 1, "second": 2}, "it") == Long(1, 2)
    assert parse(Form, {"first": 1, "note": "a"}, "it") == Short(1, "a")
    with pytest.raises(
        InputError, match=r"^it\.third: unknown key; there are: first, second, note$"
    ):
        parse(Form, {"first": 1, "third": 3}, "it")
    with pytest.raises(InputError, match=r"^it: None must be a mapping of keys to values$"):
        parse(Form, None, "it")
    with pytest.raises(InputError, match=r"^it\.first: is missing; the short form needs it$"):
        parse(Form, {"note": "b"}, "it")


def test_numbers_keep_all_their_digits() -> None:
    """They pass through JSON."""
    random = np.random.default_rng(1)
    bits = random.integers(0, 2**63, 10_000, dtype=np.uint64).view(np.float64)
    numbers = bits[np.isfinite(bits)].tolist()
    assert parse(list[float], numbers) == numbers
    assert parse(FloatArray, numbers).tolist() == numbers
    assert parse(float, 2**53 - 1) == 2**53 - 1


def test_infinity_is_accepted_only_where_allowed() -> None:
    assert parse(list[float], [1, float("inf")], finite=False) == [1, float("inf")]


def test_schema_describes_the_conditions() -> None:
    found = schema(Plant)
    assert found["additionalProperties"] is False
    assert found["required"] == ["step", "noise", "start"]
    assert found["properties"]["step"]["exclusiveMinimum"] == 0
