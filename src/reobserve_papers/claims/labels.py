"""Choices in words: names, units and readings for tables, pages, the report and plots."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from reobserve_papers.claims.choices import Choice, Knob
from reobserve_papers.parameters.config import refuse_unknown
from reobserve_papers.parameters.parameters import Parameters
from reobserve_papers.parameters.step_kinds import SECTIONS
from reobserve_papers.parameters.units import TIMING

_ORDINALS = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth")
_NO_UNITS = ("word", "file", "name", "1")
_TIMED = {"frequency": "rad/s", "phase": "rad", "period": "s", "from": "s", "until": "s"}


@dataclass(frozen=True)
class Label:
    """A choice in words, what it belongs to, and its unit, if it has one.

    ``notes`` say of values, by `spelt`, that the paper states, names or excludes them.
    """

    words: str
    of: str = ""
    unit: str = ""
    notes: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.words} ({self.of})" if self.of else self.words


def labels(
    parameters: Parameters, choices: Iterable[Choice], excluded: Mapping[str, Mapping[str, str]]
) -> dict[str, Label]:
    """The labels of choices by name, of whose words the paper ``excluded`` some readings."""
    choices = list(choices)
    knobs = {knob.name: knob for choice in choices for knob in choice.knobs}
    words = {key: list(map(spelt, one.words)) for one in knobs.values() for key in one.keys}
    refuse_unknown("excluded", excluded, [key for key, known in words.items() if known])
    for key, one in excluded.items():
        refuse_unknown(f"excluded.{key}", one, words[key])
    named = {name: Label(name) for choice in choices for name in choice.names}
    return named | {name: _label(parameters, knob, excluded) for name, knob in knobs.items()}


def _label(parameters: Parameters, knob: Knob, excluded: Mapping[str, Mapping[str, str]]) -> Label:
    entry = parameters.by_key[knob.keys[0]]
    section, *_, name = knob.keys[0].split(".")
    owners = dict.fromkeys(" ".join(key.split(".")[1:-1]) for key in knob.keys)
    of = section
    if all(owners):
        singular = {plural: one for one, plural in SECTIONS.items()}.get(section, section)
        of = f"{singular if len(owners) == 1 else section} {listed([*owners])}"
    notes = dict.fromkeys(map(spelt, entry.get("named", ())), "named by the paper")
    if entry["source"] != "assumed":
        notes.setdefault(spelt(knob.value), "stated by the paper")
    for reading, where in (item for key in knob.keys for item in excluded.get(key, {}).items()):
        notes[reading] = f"excluded by {where}"
    words, unit = _placed(name, knob.path, entry), _unit(knob.path, entry)
    return Label(_plain(words), _plain(of), unit, notes)


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
    """Words for each reading of a choice, by `spelt`: of signals, what distinguishes them."""
    items: dict[str, set[str]] = {}
    for term in (term for value in values if _is_signal(value) for term in value):
        for key, item in term.items():
            items.setdefault(key, set()).add(spelt(item))
    return {spelt(value): _plain(_reading(value, items)) for value in values}


def listed(words: Sequence[str], joint: str = "and") -> str:
    """Words in a row, the last one after the joint."""
    return f" {joint} ".join(filter(None, (", ".join(words[:-1]), *words[-1:])))


def _is_signal(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(term, Mapping) for term in value)


def _reading(value: Any, items: Mapping[str, set[str]]) -> str:
    if not _is_signal(value):
        return ", ".join(map(spelt, value)) if isinstance(value, list) else spelt(value)
    return " and ".join(
        " ".join(
            item if key == "kind" else f"{key} {spelt(item)}"
            for key, item in term.items()
            if key == "kind" or len(items[key]) > 1
        )
        for term in value
    )


def _placed(name: str, path: Sequence[str | int], entry: Mapping[str, Any]) -> str:
    """The name of an entry, and the place in its value."""
    if path in ((0,), (1,)) and len(entry["value"]) == 2 and entry["unit"] == "s":
        return f"{('beginning', 'end')[int(path[0])]} of the window {name}"
    parts = [name]
    for depth, step in enumerate(path):
        if isinstance(step, str):
            parts.append(step)
        elif depth == 0 and step < len(_ORDINALS):
            parts[0] = f"{_ORDINALS[step]} {name.removesuffix('s')}"
        else:
            parts.append(f"number {step + 1}")
    return " of the ".join(reversed(parts))


def _unit(path: Sequence[str | int], entry: Mapping[str, Any]) -> str:
    """The unit of a number, of a term of a signal or of a component."""
    units = re.split(", | to ", entry["unit"])
    if path and isinstance(path[-1], str):
        units = [_TIMED.get(path[-1]) or next((one for one in units if one not in TIMING), "")]
    elif path and len(units) == len(entry["value"]):
        units = [units[int(path[0])]]
    return "" if len(units) > 1 or units[0] in _NO_UNITS else units[0]


def _plain(text: str) -> str:
    return text.replace("_", " ")
