"""Choices that a paper leaves open: random samples of them, and single changes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from itertools import product
from typing import Any

import numpy as np

from reobserve.core.errors import InputError, nearest
from reobserve_papers.parameters.overrides import follow, links_in
from reobserve_papers.parameters.parameters import Parameters, leaves, matches
from reobserve_papers.signals.random_streams import random_stream

SEED = "seed"  # the root of all random streams: nobody states it

_MOST_CELLS = 64  # combinations of discrete choices that are counted instead of sampled

_DECADE = 10.0  # a range that spans as much is one of magnitudes


@dataclass(frozen=True)
class Knob:
    """One number (or word) of a choice, and where it may stand.

    ``keys`` are the entries that it stands for, ``span`` is the interval of a number, ``words``
    are the alternatives of anything else. ``named`` are those of the values that the paper names:
    half of the samples take one of them.
    """

    keys: tuple[str, ...]
    path: tuple[str | int, ...]
    value: Any
    span: tuple[float, float] = (0.0, 0.0)
    multiple: float = 0.0
    words: tuple[Any, ...] = ()
    named: tuple[Any, ...] = field(default=(), repr=False)

    @property
    def levels(self) -> tuple[Any, ...]:
        """The values where they are few words or whole numbers, else none."""
        if self.words:
            return self.words
        low, high = self.span
        whole = all(type(number) is int for number in (self.value, low, high))
        if not whole or self.multiple or high - low >= _MOST_CELLS:
            return ()
        return tuple(range(int(low), int(high) + 1))

    @property
    def name(self) -> str:
        """The parameter keys, in one with braces for what differs, and the place in the value."""
        return ".".join((_in_one(self.keys), *map(str, self.path)))

    @property
    def logarithmic(self) -> bool:
        """True if it is the magnitude that is open."""
        low, high = self.span
        return low > 0 and high >= _DECADE * low

    def place(self, value: float) -> float:
        """The place of a value in the range, from 0 to 1."""
        low, high = self.span
        if high == low:
            return 0.0
        value = min(max(value, low), high)
        if self.logarithmic:
            return math.log(value / low) / math.log(high / low)
        return (value - low) / (high - low)

    def at(self, place: float) -> Any:
        """The value at a place of the range, on the grid that the code asks for."""
        low, high = self.span
        value = low * (high / low) ** place if self.logarithmic else low + (high - low) * place
        if self.multiple:
            # Twelve digits: 3 * 0.1 is meant to be 0.3.
            value = float(f"{round(value / self.multiple) * self.multiple:.12g}")
        value = min(max(value, low), high)
        whole = all(isinstance(number, int) for number in (self.value, *self.span))
        return round(value) if whole else value

    def drawn(self, stream: np.random.Generator) -> Any:
        """A random value of those that another reader could have set."""
        if self.named and stream.random() < 0.5:
            return self.named[int(stream.integers(len(self.named)))]
        if self.words:
            return self.words[int(stream.integers(len(self.words)))]
        return self.at(float(stream.random()))


@dataclass(frozen=True)
class Choice:
    """Parameters that somebody would set together, or the seed (without knobs)."""

    keys: tuple[str, ...]
    knobs: tuple[Knob, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the sampled values."""
        return tuple(knob.name for knob in self.knobs) or self.keys


def find_choice(parameters: Parameters, pattern: str, groups: Iterable[str] = ()) -> Choice:
    """The choice of a key or a pattern of keys, with ``groups`` that an error may suggest."""
    if pattern == SEED:
        return Choice((SEED,), ())
    entries = parameters.by_key
    keys = tuple(key for key in entries if fnmatchcase(key, pattern))
    if not keys:
        near = nearest(pattern, [*groups, SEED, *entries])
        raise InputError("depends_on", f"there is no {pattern!r}{near}")
    for key in keys:
        if "range" not in entries[key]:
            raise InputError("depends_on", f"{key} is stated ({entries[key]['source']}), no choice")
        if entries[key].get("numerical"):
            raise InputError("depends_on", f"{key} is a numerical resolution, no choice")
    return Choice(keys, tuple(_knobs(keys, entries[keys[0]])))


def cells(choices: Iterable[Choice]) -> list[tuple[Any, ...]] | None:
    """All values that the choices can have together, or None if these are not few and discrete."""
    levels = [choice_levels for choice in choices for choice_levels in _levels(choice)]
    if not levels or not all(levels) or math.prod(map(len, levels)) > _MOST_CELLS:
        return None
    return list(product(*levels))


def _levels(choice: Choice) -> list[tuple[Any, ...]]:
    """The values of each knob, none where these are no few words or counts."""
    return [knob.levels for knob in choice.knobs] or [()]


def with_values(
    parameters: Parameters, choices: Iterable[Choice], values: Iterable[Any]
) -> Parameters:
    """The parameters with these values of the choices, one for each of their names."""
    choices = list(choices)
    drawn, seed, left = parameters.tree, parameters.seed, iter(values)
    for choice in choices:
        for knob in choice.knobs:
            drawn = _turned(drawn, knob, next(left))
        if choice.keys == (SEED,):
            seed = next(left)
    keys = {key for choice in choices for key in choice.keys}
    drawn = follow(drawn, links_in(parameters.entries()), keys)
    return Parameters(parameters.paper, drawn, seed)


def chosen(parameters: Parameters, choices: Iterable[Choice], number: int) -> tuple[Any, ...]:
    """The values that the reader of a number sets, one for each of the choices' names.

    He sets a choice the same, whichever others are asked of him. Where choices are few and discrete
    (see `cells`) the number is that of their combination.
    """
    choices = tuple(choices)
    if (counted := cells(choices)) is not None:
        return counted[number]

    def stream(name: str) -> np.random.Generator:
        return random_stream(parameters.seed, "claims", parameters.paper, name, str(number))

    values: list[Any] = []
    for choice in choices:
        values.extend(knob.drawn(stream(knob.name)) for knob in choice.knobs)
        if choice.keys == (SEED,):
            values.append(int(stream(SEED).integers(2**31)))
    return tuple(values)


def _knobs(keys: tuple[str, ...], entry: dict[str, Any]) -> Iterator[Knob]:
    allowed, value, named = entry["range"], entry["value"], tuple(entry.get("named", ()))
    if isinstance(allowed, dict) and "choices" in allowed:
        yield Knob(keys, (), value, words=tuple(allowed["choices"]), named=named)
        return
    intervals = allowed if isinstance(allowed, dict) else {"": allowed}
    grids = entry.get("multiple_of", {})
    if not isinstance(grids, dict):
        grids = dict.fromkeys(intervals, grids)
    for path, leaf in leaves(value):
        spans = [span for place, span in intervals.items() if matches(place, path)]
        if spans:
            span = max(low for low, _ in spans), min(high for _, high in spans)
            multiple = [grid for place, grid in grids.items() if matches(place, path)]
            yield Knob(keys, path, leaf, span, multiple[0] if multiple else 0.0, named=named)


def _in_one(keys: tuple[str, ...]) -> str:
    """The text ``a.{b,c}.d`` for a.b.d and a.c.d, or the first if they differ in several parts."""
    columns = list(zip(*(key.split(".") for key in keys), strict=False))
    differing = [column for column in columns if len(set(column)) > 1]
    if len(differing) != 1 or len({key.count(".") for key in keys}) > 1:
        return keys[0]
    return ".".join(
        f"{{{','.join(column)}}}" if column in differing else column[0] for column in columns
    )


def _turned(tree: Any, knob: Knob, value: Any) -> Any:
    """The tree of a parameter file with one number another."""
    for key in knob.keys:
        tree = _with(tree, (*key.split("."), "value", *knob.path), value)
    return tree


def _with(tree: Any, place: tuple[str | int, ...], value: Any) -> Any:
    """A tree with another value at a place, which shares all that is off the way there."""
    if not place:
        return value
    changed = tree.copy()
    changed[place[0]] = _with(tree[place[0]], place[1:], value)
    return changed
