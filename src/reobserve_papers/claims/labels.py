"""Choices in words: names, units and readings for tables, pages, the report and plots."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from reobserve_papers.claims.choices import Choice, Knob
from reobserve_papers.parameters.config import refuse_unknown
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.units import TIMING

Excluded = Mapping[str, Mapping[str, str]]


@dataclass(frozen=True)
class Label:
    """A choice in words: its name, what it belongs to, its unit, and each reading by `spelt`.

    ``notes`` say of values, by `spelt`, that the paper states, names or excludes them.
    """

    words: str
    of: str = ""
    unit: str = ""
    readings: Mapping[str, str] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.words} ({self.of})" if self.of else self.words


def labels(
    parameters: Parameters, choices: Iterable[Choice], excluded: Excluded
) -> dict[str, Label]:
    """The labels of choices by name, of whose words the paper ``excluded`` some readings."""
    knobs = {knob.name: knob for choice in choices for knob in choice.knobs}
    words = {key: knob.words for knob in knobs.values() for key in knob.keys if knob.words}
    refuse_unknown("excluded", excluded, words)
    for key, listed in excluded.items():
        refuse_unknown(f"excluded.{key}", listed, list(map(spelt, words[key])))
    return {name: _label(parameters, knob, excluded) for name, knob in knobs.items()}


def spelt(value: Any) -> str:
    """A value of a choice or of a convention, for a reader."""
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return " to ".join(map(spelt, value)) if len(value) == 2 else ", ".join(map(spelt, value))
    if isinstance(value, Mapping):
        return ", ".join(f"{spelt(key)} {spelt(item)}" for key, item in value.items())
    return str(value)


def readings(values: Sequence[Any]) -> dict[str, str]:
    """Words for each reading of a choice, by `spelt`: of signals those in which they differ."""
    terms = [term for value in values if isinstance(value, list) for term in value]
    items = {(key, spelt(term[key])) for term in terms if isinstance(term, dict) for key in term}
    keys = [key for key, _ in items]

    def words(value: Any) -> str:
        if isinstance(value, list):
            return ", ".join(map(words, value))
        if isinstance(value, dict):
            value = " ".join(f"{key} {spelt(value[key])}" for key in value if keys.count(key) > 1)
        return spelt(value).removeprefix("kind ").replace("_", " ")

    return {spelt(value): words(value) for value in values}


def _label(parameters: Parameters, knob: Knob, excluded: Excluded) -> Label:
    entry = parameters.by_key[knob.keys[0]]
    of, *_, name = knob.keys[0].split(".")
    owners = ", ".join(dict.fromkeys(" ".join(key.split(".")[1:-1]) for key in knob.keys))
    of = f"{of} {owners}" if "," in owners else f"{of.removesuffix('s')} {owners}" if owners else of
    stated = () if entry["source"] == "assumed" else (knob.value,)
    notes = dict.fromkeys(map(spelt, stated), "stated by the paper")
    notes |= dict.fromkeys(map(spelt, knob.named), "named by the paper")
    for key in knob.keys:
        notes |= {word: f"excluded by {where}" for word, where in excluded.get(key, {}).items()}
    words = {
        key: f"{text} ({notes[key]})" if key in notes else text
        for key, text in readings(knob.words).items()
    }
    of, name = (text.replace("_", " ") for text in (of, _placed(name, knob.path, entry)))
    return Label(name, of, _unit(knob.path, entry), words, notes)


def _placed(name: str, path: Sequence[str | int], entry: Mapping[str, Any]) -> str:
    """The name of an entry, and the place in its value."""
    if path in ((0,), (1,)) and len(entry["value"]) == 2 and entry["unit"] == "s":
        return f"{('beginning', 'end')[int(path[0])]} of the window {name}"
    if path:
        name = f"{name.removesuffix('s')} {int(path[0]) + 1}"
    return " of ".join([*map(str, reversed(path[1:])), name])


def _unit(path: Sequence[str | int], entry: Mapping[str, Any]) -> str:
    """The unit of a number, of a term of a signal or of a component."""
    units = re.split(", | to ", entry["unit"])
    if path and isinstance(path[-1], str):
        own = next((unit for unit in units if unit not in TIMING), "")
        units = [{"frequency": "rad/s", "phase": "rad"}.get(path[-1], own)]
    elif path and len(units) == len(entry["value"]):
        units = [units[int(path[0])]]
    return units[0] if len(units) == 1 and units[0] not in ("word", "file", "name", "1") else ""
