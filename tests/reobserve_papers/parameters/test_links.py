"""Entries that take their value from another one: ``same_as`` in parameter files."""

from __future__ import annotations

from typing import Any

import pytest

from reobserve.core.errors import InputError
from reobserve_papers.claims.choices import chosen, find_choice, with_values
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.overrides import links_in, resolve
from reobserve_papers.parameters.parameters import Parameters
from tests import ROOT

ENTRY = {"value": 1.0, "unit": "m", "source": "p. 1"}
TREE: dict[str, Any] = {
    "plant": {"a": ENTRY, "b": {"same_as": "plant.a", "source": "assumed", "why": "As a."}},
    "observers": {"one": {"label": "x", "c": {"same_as": "plant.b"}}},
}


def values(tree: dict[str, Any]) -> tuple[float, ...]:
    plant = tree["plant"]
    return plant["a"]["value"], plant["b"]["value"], tree["observers"]["one"]["c"]["value"]


@pytest.mark.parametrize(
    ("overrides", "found"),
    [
        ({}, (1, 1, 1)),
        ({"plant": {"a": 2}}, (2, 2, 2)),
        ({"plant": {"b": 2}}, (1, 2, 2)),
        ({"observers": {"one": {"c": 2}}}, (1, 1, 2)),
        ({"plant": {"a": 3}, "observers": {"one": {"c": {"value": 2}}}}, (3, 3, 2)),
    ],
)
def test_linked_value_follows_until_overridden(
    overrides: dict[str, Any], found: tuple[float, ...]
) -> None:
    assert values(resolve(TREE, overrides, "toy")) == found


def test_link_has_the_unit_of_its_target_and_its_own_texts() -> None:
    found = resolve(TREE, {}, "toy")["plant"]["b"]
    assert found == {
        "value": 1.0, "unit": "m", "source": "assumed", "why": "As a.", "same_as": "plant.a"
    }  # fmt: skip
    found = resolve(TREE, {"plant": {"a": 2}}, "toy")["plant"]["b"]
    assert found["source"] == "user override"


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        (
            {"same_as": "plant.aa"},
            "toy.plant.b.same_as: there is no entry 'plant.aa'; did you mean",
        ),
        ({"same_as": "plant"}, "toy.plant.b.same_as: there is no entry 'plant'"),
        ({"same_as": "plant.b"}, "toy.plant.b.same_as: 'plant.b' is the same as itself"),
        ({"same_as": "plant.a", "value": 1.0}, "toy.plant.b.value: must not stand beside same_as"),
    ],
)
def test_link_to_a_missing_entry_is_refused(entry: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as caught:
        resolve({"plant": {"a": ENTRY, "b": entry}}, {}, "toy")
    assert str(caught.value).startswith(said)


@pytest.mark.parametrize("paper", known_papers(ROOT))
def test_every_link_of_a_paper_follows_its_target(paper: str) -> None:
    entries = dict(Parameters.load(ROOT, paper).entries())
    for key, target in links_in(iter(entries.items())).items():
        assert entries[key]["value"] == entries[target]["value"], key


def test_theory_and_observers_follow_the_scenario_and_the_plant() -> None:
    fault = [{"kind": "constant", "axis": 1, "from": 5.0, "size": 0.4}]
    overrides = {
        "plant": {"initial_rate": [0.08, -0.03, 0.04]},
        "scenarios": {"aperiodic": {"fault": fault}},
    }
    parameters = Parameters.load(ROOT, "ilo", overrides)
    assert parameters.section("theory", "aperiodic") == fault
    for observer in parameters.section("observers").values():
        assert observer["initial_rate"] == [0.08, -0.03, 0.04]


def test_samples_preserve_links() -> None:
    parameters = Parameters.load(ROOT, "ilo", seed=1)
    choice = find_choice(parameters, "plant.initial_rate")
    rates = chosen(parameters, [choice], 3)
    sampled = with_values(parameters, [choice], rates)
    assert list(rates) == sampled.section("plant", "initial_rate")
    assert list(rates) == sampled.section("observers", "adaptive", "initial_rate")
    both = [choice, find_choice(parameters, "observers.*.initial_rate")]
    apart = with_values(parameters, both, chosen(parameters, both, 3))
    assert apart.section("plant", "initial_rate") == list(rates)
    assert apart.section("observers", "adaptive", "initial_rate") != list(rates)
    moved = with_values(parameters, [choice], (0.07, *rates[1:]))
    assert moved.section("observers", "sampled", "initial_rate")[0] == 0.07
