"""Entries of parameter files have the units that their papers declare, in any spelling."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any

import pytest

from reobserve.core.errors import InputError
from reobserve.core.units import readings
from reobserve_papers.cli.main import main
from reobserve_papers.parameters.config import known_papers
from reobserve_papers.parameters.job import read_parameters
from reobserve_papers.parameters.parameters import Parameters, leaves
from reobserve_papers.parameters.units import TIMING, Unit, check_units
from tests import ROOT

PAPERS = known_papers(ROOT)


def with_unit(parameters: Parameters, key: str, unit: str) -> Parameters:
    """The parameters with one entry alone, in another unit."""
    tree: dict[str, Any] = {**parameters.by_key[key], "unit": unit}
    for word in reversed(key.split(".")):
        tree = {word: tree}
    return replace(parameters, tree=tree)


def changed(text: str, change: Any) -> Iterator[str]:
    """The unit of an entry with each of its components changed in turn, where it can be."""
    components = re.split("(, | to )", text)
    for place in range(0, len(components), 2):
        other = change(components[place])
        if other != components[place]:
            yield "".join([*components[:place], other, *components[place + 1 :]])


def multiple(prefix: str, unit: str) -> str:
    """The unit with its first symbol times 0.001 or 1000, other than y and u."""
    special = {"1": {"m": "‰", "k": "%"}, "kg": {"m": "g", "k": "Mg"}}

    def times(match: re.Match[str]) -> str:
        return special.get(match[0], {}).get(prefix, f"{prefix}{match[0]}")

    return re.sub(r"^1$|(?<![\w^])(?![yu]\b)[^\W\d_]+", times, unit, count=1)


@cache
def respelt(unit: str) -> str:
    """The unit in base units, or with signs of products where y and u are in it."""
    product = unit.replace(" ", "*")
    if re.search(r"\b[yu]\b", unit):
        return product
    return str((1.0 * readings(unit)[0]).to_base_units().units)


@pytest.mark.parametrize("paper", PAPERS)
def test_other_units_are_refused_and_other_spellings_are_not(paper: str) -> None:
    parameters = Parameters.load(ROOT, paper)
    stated = read_parameters(parameters)
    check_units(parameters, stated)
    for key, entry in parameters.entries():
        unit = entry["unit"]
        wrong = [*changed(unit, lambda _: "furlong"), *changed(unit, lambda _: "kg mol")]
        if all(isinstance(value, str | bool) for _, value in leaves(entry["value"])):
            expected = ["file"] if unit == "file" else ["word"]
        else:
            expected = unit.split(", ")
            for prefix in "mk":
                wrong += changed(unit, partial(multiple, prefix))
            wrong += [f"{unit}, kg", "file", ""]
            for other in changed(unit, respelt):
                check_units(with_unit(parameters, key, other), stated)
        for other in wrong:
            with pytest.raises(InputError) as caught:
                check_units(with_unit(parameters, key, other), stated)
            said = str(caught.value)
            assert said.startswith(f"{paper}.{key}.unit: {other!r} must be "), said
            assert all(one in said for one in expected), said


# By paper: the key that decides, and the unit of each key for each of its words.
DECIDED = {
    "delay": ("model", {
        "initial_state": {"pendulum": "rad, rad/s", "lag": "1"},
        "initial_estimate": {"pendulum": "rad, rad/s", "lag": "1"},
        "input": {"pendulum": "N m", "lag": "1"},
        "threshold": {"pendulum": "N/(kg m s)", "lag": "1/s"},
        "L": {"pendulum": "N m/s^3", "lag": "1/s^3"},
    }),
    "imm": ("input_unit", {"input": {"V": "V", "rad/s": "rad/s"}}),
}  # fmt: skip


@pytest.mark.parametrize("paper", DECIDED)
def test_unit_is_that_of_the_plant_of_its_branch(paper: str) -> None:
    """All entries of keys of which two plants have different units."""
    decides, units = DECIDED[paper]
    parameters = Parameters.load(ROOT, paper)
    stated, tried = read_parameters(parameters), set()
    for key in parameters.by_key:
        section, name, *last = key.split(".")
        branch = getattr(stated, section)
        word = getattr(branch.get(name), decides, None) if isinstance(branch, dict) else None
        if word is None or last[0] not in units:
            continue
        tried.add(last[0])
        for other, unit in units[last[0]].items():
            changed_unit = with_unit(parameters, key, unit)
            if other == word:
                check_units(changed_unit, stated)
            else:
                with pytest.raises(InputError, match=re.escape(f"{key}.unit: {unit!r} must be ")):
                    check_units(changed_unit, stated)
    assert tried == {*units}


@dataclass(frozen=True)
class Keys:
    free: Any
    none: list[float]
    text: str
    maybe: Annotated[list[float], Unit("m")] | None
    speed: Annotated[list[Any], Unit("rad/s", beside=("rad/s^2", *TIMING))]


VALUES: dict[str, Any] = {
    "free": 1.0, "none": [], "text": "a", "maybe": [1.0], "speed": [{"size": 1.0}]
}  # fmt: skip


@pytest.mark.parametrize(
    ("key", "unit", "problem"),
    [
        ("free", "furlong", ""), ("free", "y/u, m to y s", ""), ("free", "word", ""),
        ("none", "s", ""),
        ("free", "cumecs", "'cumecs' is no unit that is known"),
        ("free", "m, m3/s!", "'m3/s!' is no unit"),
        ("text", "name", ""), ("text", "1", ""),
        ("text", "s", "'s' must be word; the value is no number"),
        ("maybe", "N s^2/kg", ""), ("maybe", "cumecs", "'cumecs' must be m"),
        ("maybe", "m, m", "'m, m' must be m"),
        ("speed", "s, rad/s", ""), ("speed", "rad s^-1", ""), ("speed", "rad/s/s, rad/s, sec", ""),
        ("speed", "s, rad", "'s, rad' must be rad/s, with rad/s^2, s, rad/s, rad, Hz in its terms"),
        ("speed", "rad/s, ms", "'rad/s, ms' must be rad/s, with"),
        ("speed", "Hz", "'Hz' must be rad/s"),
    ],
)  # fmt: skip
def test_key_may_be_free_text_optional_or_a_signal(key: str, unit: str, problem: str) -> None:
    tree = {"plant": {key: {"value": VALUES[key], "unit": unit}}}
    parameters, stated = Parameters("mine", tree, 0), {"plant": Keys(**VALUES)}
    if not problem:
        check_units(parameters, stated)
        return
    with pytest.raises(InputError, match=rf"^mine\.plant\.{key}\.unit: .*{re.escape(problem)}"):
        check_units(parameters, stated)


@pytest.mark.parametrize(("unit", "value"), [("s", 1.0), ("sec", 1.0), ("1", 2.0), ("rad", 2.0)])
def test_numerical_step_is_halved_in_any_spelling_of_its_unit(unit: str, value: float) -> None:
    entry = {"value": 2.0, "unit": unit, "numerical": True}
    refined = Parameters("mine", {"plant": {"step": entry}}, 0).refined()
    assert refined.section("plant") == {"step": value}


def test_command_names_the_key_and_both_units(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(ROOT / "config", tmp_path / "config")
    path = tmp_path / "config/papers/ilo.yaml"
    entry = "K2:\n      value: 5000.0\n      unit: "
    text = path.read_text(encoding="utf-8")
    assert f"{entry}N m s/rad\n" in text
    path.write_text(text.replace(f"{entry}N m s/rad\n", f"{entry}furlong\n"), encoding="utf-8")
    assert main(["check", "ilo", "--project", str(tmp_path)]) == 1
    said = "reobserve-papers: ilo.observers.sampled.K2.unit: 'furlong' must be N m s/rad\n"
    assert capsys.readouterr().err == said
