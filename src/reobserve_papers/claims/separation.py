"""The one choice that separates the samples in which a claim holds from the others.

A choice splits the samples in two: some readings of a word and the others, or the numbers up to a
threshold and those above it. A split explains the fall of Gini's impurity over the impurity of all
(Breiman et al. 1984, Classification and Regression Trees): 1 if the claim holds on one side and
nowhere else, 0 if it holds as often on both.

One looks at all splits of all choices, so that the best would explain something by chance. So it is
found in a random half of the samples, and what it explains is computed from the other half. Samples
have the same weights: a reading that fewer of them have counts less in what is explained, and not
in the shares of both sides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reobserve_papers.claims.inquiry import Robustness
from reobserve_papers.claims.labels import Label, listed, readings, spelt
from reobserve_papers.claims.outcomes import Outcome
from reobserve_papers.claims.registry import Claim
from reobserve_papers.signals.random_streams import random_stream

SIDE = 10  # samples of each side, in each half; with less, the share of a side says little
DECIDES = 0.2  # explained by a choice that is said to separate the outcomes

_Mask = NDArray[np.bool_]
_Counts = NDArray[Any]


@dataclass(frozen=True)
class Side:
    """The values of a choice on one side, and in how many samples with them a claim holds."""

    values: tuple[Any, ...]
    held: int
    samples: int


@dataclass(frozen=True)
class Split:
    """The best split by a choice: what it explains where it was found, and in the other half.

    A number up to the ``threshold`` is on the first side.
    """

    found: float
    explained: float
    sides: tuple[Side, Side]
    threshold: float | None


@dataclass(frozen=True)
class Separation:
    """The choice that separates the outcomes of a claim, if one does, and a sentence.

    ``explained`` is by the choice that explained most where it was found, none if samples are too
    few to tell. ``splits`` are those of all choices, that of ``choice`` first.
    """

    choice: str
    sentence: str
    explained: float | None = None
    splits: Mapping[str, Split] = field(default_factory=dict)


def separation(claim: Claim, robustness: Robustness, outcomes: Sequence[Outcome]) -> Separation:
    """Find the choice that separates the outcomes of a claim most."""
    held = np.array([word == "holds" for word in outcomes])
    whole = len(held) == robustness.whole
    found, stated = halves(len(held), whole=whole)
    columns = zip(*(trial.values for trial in robustness.trials), strict=True)
    tried = {
        name: best_split(values, held, found, stated)
        for name, values in zip(robustness.names, columns, strict=True)
        if not name.endswith("seed") and len(set(map(repr, values))) > 1
    }
    splits = {name: split for name, split in tried.items() if split}
    best = max(splits, key=lambda name: splits[name].found, default="")
    choice = best if best and splits[best].explained >= DECIDES else ""
    if choice:
        sentence = in_words(splits[choice], claim.label(choice))
    elif len(splits) < len(tried):
        kind = "settings" if whole else "samples"
        return Separation("", f"{len(held)} {kind} are too few to tell which choice decides")
    else:
        sentence = "no single choice decides"
    ranked = sorted(splits, key=lambda name: (name != choice, -splits[name].explained))
    explained = splits[best].explained if best else None
    return Separation(choice, sentence, explained, {name: splits[name] for name in ranked})


def halves(samples: int, *, whole: bool) -> tuple[_Mask, _Mask]:
    """The samples in which splits are found, and those from which they are stated.

    Both are all samples if these are the ``whole`` of all settings.
    """
    found = np.ones(samples, dtype=bool)
    if whole:
        return found, found
    found[random_stream(0, "halves").permutation(samples)[samples // 2 :]] = False
    return found, ~found


def best_split(values: Sequence[Any], held: _Mask, found: _Mask, stated: _Mask) -> Split | None:
    """The split by a choice that explains most where it is ``found``.

    None if no split has enough samples on both sides of both halves. Readings of a word are in the
    order of their shares: one of the splits in this order explains as much as any set of readings.
    """
    places = np.array(as_places(values))
    if not _are_numbers(values):
        codes = places.astype(int)
        many, holding = (np.bincount(codes, mask) for mask in (found, found & held))
        places = np.argsort(np.argsort(holding / np.maximum(many, 1), kind="stable"))[codes]
    ends, ranks = np.unique(places, return_inverse=True)
    counts = [
        (np.cumsum(np.bincount(ranks, half)), np.cumsum(np.bincount(ranks, half & held)))
        for half in (found, stated)
    ]
    enough = np.all([np.minimum(n, n[-1] - n) >= SIDE for n, _ in counts], axis=0)
    if not enough.any():
        return None
    falls = np.where(enough, explained(*counts[0]), -1.0)
    best = np.flatnonzero(falls == falls.max())
    cut = best[len(best) // 2]
    threshold = rounded(*ends[cut : cut + 2]) if _are_numbers(values) else None
    samples, holds = counts[1]
    sides = [(ranks <= cut, holds[cut], samples[cut])]
    sides += [(ranks > cut, holds[-1] - holds[cut], samples[-1] - samples[cut])]
    low, high = (
        Side(_readings(values, where) if threshold is None else (), int(h), int(n))
        for where, h, n in sides
    )
    return Split(float(falls[cut]), float(explained(samples, holds)[cut]), (low, high), threshold)


def explained(samples: _Counts, held: _Counts) -> _Counts:
    """The fall of Gini's impurity by splits over the impurity of all.

    The counts are those up to each value, the last one of all. The fall is the squared correlation
    of outcome and side, (n h_1 - h n_1)^2 / (n_1 (n - n_1) h (n - h)).
    """
    n, h = samples[-1], held[-1]
    scale = samples * (n - samples) * h * (n - h)
    fall: _Counts = (n * held - h * samples) ** 2 / np.where(scale > 0, scale, np.inf)
    return fall


def rounded(low: float, high: float) -> float:
    """The middle of two numbers with the fewest digits, equal to the lower one or between them."""
    tried = (float(f"{low + (high - low) / 2:.{digits}g}") for digits in range(1, 17))
    return next((middle for middle in tried if low <= middle < high), float(low))


def as_places(values: Sequence[Any]) -> list[float]:
    """Numbers as they are, and anything else by its place among those that were sampled."""
    if _are_numbers(values):
        return [float(value) for value in values]
    places: list[float] = np.unique(list(map(repr, values)), return_inverse=True)[1].tolist()
    return places


def in_words(split: Split, label: Label) -> str:
    """Both sides of a split, the one on which the claim holds more often first."""
    first, last = sorted(split.sides, key=lambda side: -side.held / side.samples)
    values = [value for side in split.sides for value in side.values]
    end, name, again, about = "", f"{label} ", "", ""
    if split.threshold is not None:
        end = f"{repr(split.threshold).removesuffix('.0')} {label.unit}".strip()
    elif all(isinstance(value, str) for value in values):
        name, again, about = "", "with ", ", ".join(filter(None, (label.words, label.of)))
    else:
        name, again, about = f"{label.words} ", "with ", label.of
    return (
        f"holds with {name}{_which(split, first, label, end)} in {first.held} of {first.samples} "
        f"samples, {again}{_which(split, last, label, 'it')} in {last.held} of {last.samples}"
        f"{_in_brackets(about)}"
    )


def _which(split: Split, side: Side, label: Label, end: str) -> str:
    """The values on one side of a split, with what the paper says of them."""
    if split.threshold is None:
        words = readings([value for side in split.sides for value in side.values])
        notes = [_in_brackets(label.notes.get(spelt(value), "")) for value in side.values]
        values = [words[spelt(value)] for value in side.values]
        return listed(list(map("".join, zip(values, notes, strict=True))), "or")
    upper = side is split.sides[1]
    said = [
        f"{value} is {note}"
        for value, note in label.notes.items()
        if (float(value) > split.threshold) == upper
    ]
    return f"{'above' if upper else 'up to'} {end}{_in_brackets(', '.join(said))}"


def _in_brackets(text: str) -> str:
    return f" ({text})" if text else ""


def _readings(values: Sequence[Any], where: _Mask) -> tuple[Any, ...]:
    """The different readings in some samples, in the order of their first samples."""
    kept = (value for value, here in zip(values, where, strict=True) if here)
    return tuple({spelt(value): value for value in kept}.values())


def _are_numbers(values: Sequence[Any]) -> bool:
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
