"""A parameter that is wrong by one per cent changes a golden number beyond its tolerance."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from reobserve.core.errors import InputError
from reobserve_papers.golden.comparison import compare
from reobserve_papers.golden.number_files import golden_file, read_numbers
from reobserve_papers.golden.values import evaluated_numbers
from reobserve_papers.parameters.parameters import Parameters, leaves, matches
from reobserve_papers.steps.evaluation import Evaluator
from tests.reobserve_papers.pipeline.conftest import EVALUATORS, PAPERS, PARAMETER_FILES, ROOT

Place = tuple[str | int, ...]  # position in a value: empty for the value itself

# Words in a key or position that mark numbers used as names.
NAMES = {"axis", "component", "powers"}
# Flags of entries on which no golden number need depend; the schema explains each.
UNNOTICED = ("numerical", "levels", "plot_only")
# Sections that make no figure: a figure shows the result of a search, not its range, and a theory
# is evaluated at its numbers.
UNSHOWN = ("searches.", "theory.")


def twin(place: Place, value: Any) -> Place:
    """The mirrored position of an entry of a symmetric matrix; any other position is its own."""
    if len(place) != 2 or not all(isinstance(step, int) for step in place):
        return place
    square = all(len(row) == len(value) for row in value)
    symmetric = square and value == list(map(list, zip(*value, strict=True)))
    return place[::-1] if symmetric else place


def is_constant(key: str, place: Place, value: Any, end: float) -> bool:
    """Whether a value is a nonzero number that takes effect before the run ends."""
    if isinstance(value, str | bool) or value == 0 or NAMES & {*key.split("."), *place}:
        return False
    unseen = (place[-1:] == ("from",) and value < 0) or (place[-1:] == ("until",) and value >= end)
    return not unseen


def constants() -> Iterator[tuple[str, str, Place]]:
    """Every number of a parameter file that is physics, a gain or a rule of the metrics."""
    for paper in PAPERS:
        end = PARAMETER_FILES[paper].section("plant").get("horizon", np.inf)
        for key, entry in PARAMETER_FILES[paper].entries():
            if key.startswith(UNSHOWN) or any(map(entry.get, UNNOTICED)):
                continue
            loose = entry.get("no_effect", [])
            for place, value in leaves(entry["value"]):
                if loose is True or any(matches(one, place) for one in loose or ()):
                    continue
                once = place == min(place, twin(place, entry["value"]), key=str)
                if once and is_constant(key, place, value, end):
                    yield paper, key, place


CONSTANTS = list(constants())


def changed(paper: str, key: str, place: Place, factor: float) -> Parameters:
    """The parameters with one number times a factor, together with its twin in a symmetric
    matrix."""
    tree = copy.deepcopy(PARAMETER_FILES[paper].tree)
    entry: Any = tree
    for word in key.split("."):
        entry = entry[word]
    for one in {place, twin(place, entry["value"])}:
        inner, last = entry, "value"
        for step in one:
            inner, last = inner[last], step
        inner[last] *= factor
    return Parameters(paper, tree, PARAMETER_FILES[paper].seed)


def parts_by_cost(paper: str) -> list[tuple[str, str]]:
    """The figures and tables of a paper with the step that shows them; studies last."""
    tree = PARAMETER_FILES[paper].tree
    figures = sorted(tree["figures"], key=lambda one: tree["figures"][one].get("study") is not None)
    return [("plot", one) for one in figures] + [("table", one) for one in tree.get("tables", {})]


def noticed(paper: str, key: str, place: Place, factor: float) -> str:
    """The first golden number that changes, or the message that refuses the value."""
    unchanged, parameters = PARAMETER_FILES[paper], changed(paper, key, place, factor)
    # Reuses unaffected results and keeps the others separate.
    evaluator = Evaluator(parameters, dict(EVALUATORS[paper]._done))
    for step, part in parts_by_cost(paper):
        if parameters.settings(step, part) != unchanged.settings(step, part):
            golden = read_numbers(golden_file(ROOT, paper, part))
            try:
                found = evaluated_numbers(evaluator, part)
            except InputError as error:
                return f"refused: {error}"
            for moved in compare(golden, found, f"{paper} {part}"):
                return str(moved)
    return ""


def is_whole(paper: str, key: str, place: Place) -> bool:
    """Whether a number is an integer, on a grid or a choice, so that one per cent more is
    refused."""
    entry = dict(PARAMETER_FILES[paper].entries())[key]
    value = dict(leaves(entry["value"]))[place]
    return isinstance(value, int) or "multiple_of" in entry or "choices" in entry.get("range", ())


def check_one_per_cent(paper: str, key: str, place: Place) -> None:
    """One per cent more is detected, or one per cent less if more is refused or undetected."""
    said = noticed(paper, key, place, 1.01)
    if not said or said.startswith("refused"):
        said = noticed(paper, key, place, 0.99) or said
    assert said, f"one per cent of {key} moves no golden number of {paper}"
    assert is_whole(paper, key, place) or not said.startswith("refused"), said


@pytest.mark.parametrize(
    ("paper", "key", "place"),
    [
        ("delay", "plant.length", ()),
        ("eso", "plant.resistance", ()),
        ("ilo", "plant.inertia", (0, 0)),
        ("ilo", "observers.sampled.K2", ()),
        ("imm", "plant.normal_numerator", (3,)),
        ("lie", "designs.linear.injection", (0, "coefficient")),
    ],
)
def test_one_per_cent_change_of_a_constant_is_detected(paper: str, key: str, place: Place) -> None:
    check_one_per_cent(paper, key, place)


@pytest.mark.nightly
@pytest.mark.parametrize(("paper", "key", "place"), CONSTANTS)
def test_one_per_cent_change_of_any_constant_is_detected(
    paper: str, key: str, place: Place
) -> None:
    check_one_per_cent(paper, key, place)


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("key", "factor"),
    [
        ("observers.sampled.update_interval", 1.25),
        ("observers.continuous.update_interval", 1.025),
        ("observers.forgetting.update_interval", 1.025),
        ("plant.noise_period", 1.25),
    ],
)
def test_one_step_longer_interval_is_detected(key: str, factor: float) -> None:
    said = noticed("ilo", key, (), factor)
    assert said
    assert not said.startswith("refused")


def test_constants_include_the_expected_keys() -> None:
    keys = [key for paper, key, _ in CONSTANTS if paper == "ilo"]
    assert {"observers.sampled.K2", "observers.matched.integral_gain"} < set(keys)
    assert len(set(keys)) > 30
    assert keys.count("plant.inertia") == 4
