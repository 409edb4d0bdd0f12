"""Choices that a paper leaves open: random samples of them, and single changes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from functools import cache, lru_cache
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

# Each word comes as often as any other in so many samples, or the next multiple of their number.
# Shorter blocks would repeat what several choices of words do together: of four choices of two
# words in blocks of two, every second sample has the opposite of all words of the one before.
_BLOCK = 12


@dataclass(frozen=True)
class Knob:
    """One number (or word) of a choice, and where it may stand.

    ``keys`` are the entries that it stands for, ``span`` is the interval of a number, ``words``
    are the alternatives of anything else, each in as many samples. ``named`` are numbers that the
    paper names: half of the samples take one of them.
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

    @property
    def block(self) -> int:
        """The number of samples in which each word comes as often, 0 for numbers."""
        return len(self.words) * math.ceil(_BLOCK / len(self.words)) if self.words else 0

    def drawn(self, seed: int, paper: str, number: int) -> Any:
        """The value that the reader of a number sets, of those that another reader could have set.

        A number has a random stream for each reader, words have one for each block of readers.
        """
        if self.words:
            block, place = divmod(number, self.block)
            order = _order(seed, paper, self.name, block, self.block)
            return self.words[order[place] % len(self.words)]
        chosen = _place(seed, paper, self.name, number, len(self.named))
        return self.named[chosen] if isinstance(chosen, int) else self.at(chosen)


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

    seed, paper = parameters.seed, parameters.paper
    values: list[Any] = []
    for choice in choices:
        values.extend(knob.drawn(seed, paper, number) for knob in choice.knobs)
        if choice.keys == (SEED,):
            values.append(int(_stream(seed, paper, SEED, number).integers(2**31)))
    return tuple(values)


def _knobs(keys: tuple[str, ...], entry: dict[str, Any]) -> Iterator[Knob]:
    allowed, value, named = entry["range"], entry["value"], tuple(entry.get("named", ()))
    if isinstance(allowed, dict) and "choices" in allowed:
        yield Knob(keys, (), value, words=tuple(allowed["choices"]))
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


def _stream(seed: int, paper: str, name: str, part: int) -> np.random.Generator:
    """The random stream of a choice, of one reader or of a block of readers."""
    return random_stream(seed, "claims", paper, name, str(part))


# Claims share choices, and each sample is asked for by many alternatives.
@lru_cache(maxsize=100_000)
def _order(seed: int, paper: str, name: str, block: int, size: int) -> list[int]:
    order: list[int] = _stream(seed, paper, name, block).permutation(size).tolist()
    return order


@lru_cache(maxsize=100_000)
def _place(seed: int, paper: str, name: str, number: int, named: int) -> int | float:
    """The index of one of so many values that are named, or the place in a range."""
    stream = _stream(seed, paper, name, number)
    if named and stream.random() < 0.5:
        return int(stream.integers(named))
    return float(stream.random())


@cache
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
