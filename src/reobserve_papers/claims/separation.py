"""The one choice that separates the samples in which a claim holds from the others.

A choice splits the samples in two: some readings of a word and the others, or numbers up to a
threshold and above it. A split explains the fall of Gini's impurity over the impurity of all
(Breiman et al. 1984, Classification and Regression Trees): 1 if the claim holds on one side only,
0 if it holds as often on both. Of all splits of all choices the best would explain something by
chance. So it is found in half of the samples, and what it explains is computed from the others.
"""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reobserve_papers.claims.inquiry import Robustness
from reobserve_papers.claims.labels import Label, spelt
from reobserve_papers.claims.outcomes import Outcome
from reobserve_papers.claims.registry import Claim
from reobserve_papers.claims.verdict_rules import DEPENDS, UNDECIDED
from reobserve_papers.signals.random_streams import random_stream

SEPARATED = (DEPENDS, UNDECIDED)  # verdicts for which a separating choice is sought
SIDE = 10  # samples of each side, in each half; with less, the share of a side says little
_HALVES = 15
DECIDES = 0.2  # explained by a choice that is said to separate the outcomes

_Mask = NDArray[np.bool_]
_Counts = NDArray[Any]


class Split(NamedTuple):
    """The best split by a choice, and what it explains where it was found and in the other half.

    Each side has values, of numbers those up to the threshold and those above it, and in that other
    half the number of samples in which the claim holds, and of all.
    """

    found: float
    explained: float
    threshold: float | None
    sides: Sequence[tuple[list[Any], int, int]]


class Separation(NamedTuple):
    """The choice that separates the outcomes, if one does, and the splits, its own first.

    ``explained`` is by the split that explained most where it was found.
    """

    choice: str
    sentence: str
    explained: float | None = None
    splits: Mapping[str, Split] = {}


def separation(claim: Claim, robustness: Robustness, outcomes: Sequence[Outcome]) -> Separation:
    """Find the choice that separates the outcomes of a claim most.

    Of some random halves it is the one that most of them find, stated by the half in the middle.
    """
    cases = [k for k, word in enumerate(outcomes) if word != "no case"]
    held = np.array([outcomes[k] == "holds" for k in cases])
    whole = len(outcomes) == robustness.whole
    kind = "settings" if whole else "samples"
    few = f"{len(held)} {kind} are too few to tell which choice decides"
    if len(held) < 4 * SIDE and not whole:
        return Separation("", few)
    if held.all() or not held.any():
        return Separation("", f"all {kind} have the same outcome")
    rows = [robustness.trials[k].values for k in cases]
    columns = ([row[k] for row in rows] for k in range(len(robustness.names)))
    tried = {
        name: values
        for name, values in zip(robustness.names, columns, strict=True)
        if not name.endswith("seed") and len(set(map(repr, values))) > 1
    }
    rounds = []
    for found in halves(len(held)):
        each = {n: best_split(v, held, found | whole, ~found | whole) for n, v in tried.items()}
        splits = {name: split for name, split in each.items() if split}
        best = max(splits, key=lambda name: splits[name].found, default="")
        rounds.append((best, splits))
    often = statistics.mode(best for best, _ in rounds)
    tried_at = sorted(
        (splits[often].explained, k) for k, (_, splits) in enumerate(rounds) if often in splits
    )
    explained, k = tried_at[(len(tried_at) - 1) // 2] if tried_at else (None, 0)
    splits = rounds[k][1]
    choice = often if explained is not None and explained >= DECIDES else ""
    if choice:
        sentence = in_words(splits[choice], claim.label(choice), kind)
    elif len(splits) < len(tried):
        return Separation("", few)
    else:
        sentence = "no single choice decides"
    ranked = sorted(splits, key=lambda name: (name != choice, -splits[name].explained))
    return Separation(choice, sentence, explained, {name: splits[name] for name in ranked})


def halves(samples: int) -> list[_Mask]:
    """Random halves of the samples, since each word comes in samples at equal distances."""
    stream = random_stream(0, "halves")
    return [stream.permutation(samples) < samples // 2 for _ in range(_HALVES)]


def best_split(values: Sequence[Any], held: _Mask, found: _Mask, stated: _Mask) -> Split | None:
    """The split by a choice that explains most where it is ``found``.

    None if no split has enough samples on both sides of both halves. Readings of a word are in the
    order of their shares: one of the splits in this order explains as much as any set of readings.
    """
    is_number = are_numbers(values)
    ends, ranks = np.unique(values if is_number else list(map(spelt, values)), return_inverse=True)
    if not is_number:
        many, holding = (np.bincount(ranks, mask) for mask in (found, found & held))
        order = np.argsort(holding / np.maximum(many, 1), kind="stable")
        ends, ranks = ends[order], np.argsort(order)[ranks]
    (n, h), (m, g) = (
        [np.cumsum(np.bincount(ranks, mask)) for mask in (half, half & held)]
        for half in (found, stated)
    )
    enough = np.minimum.reduce([n, n[-1] - n, m, m[-1] - m]) >= SIDE
    if not enough.any():
        return None
    falls = np.where(enough, explained(n, h), -1.0)
    best = np.flatnonzero(falls == falls.max())
    cut = best[len(best) // 2]
    threshold = rounded(*ends[cut : cut + 2].tolist()) if is_number else None
    low = (ends[: cut + 1].tolist(), int(g[cut]), int(m[cut]))
    high = (ends[cut + 1 :].tolist(), int(g[-1]) - low[1], int(m[-1]) - low[2])
    return Split(float(falls[cut]), float(explained(m, g)[cut]), threshold, (low, high))


def explained(samples: _Counts, held: _Counts) -> _Counts:
    """The fall of Gini's impurity by splits, over the impurity of all.

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
    return next((middle for middle in tried if low <= middle < high), low)


def in_words(split: Split, label: Label, kind: str = "samples") -> str:
    """Both sides of a split, the one on which the claim holds more often first."""
    said: list[str] = []
    for k in sorted((0, 1), key=lambda k: -split.sides[k][1] / split.sides[k][2]):
        values, held, samples = split.sides[k]
        if split.threshold is None:
            which = " or ".join(label.readings.get(value, value) for value in values)
        else:
            end = "it" if said else f"{repr(split.threshold).removesuffix('.0')} {label.unit}"
            notes = label.notes.items()
            beside = [v for v in notes if (float(v[0]) > split.threshold) == bool(k)]
            which = f"{('up to', 'above')[k]} {end.strip()}"
            which += "".join(f" ({value} is {note})" for value, note in beside)
        said.append(f"{which} in {held} of {samples}")
    if split.threshold is not None:
        return f"holds with {label} {said[0]} {kind}, {said[1]}"
    about = " of ".join(filter(None, (label.words, label.of)))
    return f"holds with {said[0]} {kind}, with {said[1]} (choice: {about})"


def are_numbers(values: Sequence[Any]) -> bool:
    """True if all values are numbers, which have an order."""
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
