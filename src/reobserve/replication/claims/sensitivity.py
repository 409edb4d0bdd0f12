"""Which choices decide a claim: how much of its deciding number each of them explains.

The measure is Chatterjee's rank correlation (2021, J. Am. Stat. Assoc. 116:2009), which is 0 where
the number does not depend on a choice and tends to 1 where it is a function of that choice alone,
rising or not. From draws at hand it estimates the Cramer-von Mises index of first order (Gamboa et
al. 2022, SIAM/ASA J. Uncertain. Quantif. 10:1). What remains below one is other choices, their
interplay, and the random seed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from reobserve.replication.claims.registry import Claim
from reobserve.replication.claims.robustness import Robustness

FEWEST = 16  # draws; with less, chance makes half of the scale


class Influence(NamedTuple):
    """Of one choice: the rank correlation, and how probable one as great is by chance."""

    name: str
    share: float
    chance: float


def deciding_check(claim: Claim, robustness: Robustness) -> int:
    """The check that fails in most draws, the first of those that fail as often."""
    drawn = [trial.outcome.numbers for trial in robustness.trials if trial.outcome.numbers]
    fails = [
        sum(not check.satisfied_by(numbers[k]) for numbers in drawn)
        for k, check in enumerate(claim.checks)
    ]
    return fails.index(max(fails))


def influences(claim: Claim, robustness: Robustness) -> list[Influence]:
    """Of every choice that is drawn from a range, greatest first; none of too few draws."""
    from scipy.stats import chatterjeexi

    if robustness.draws < FEWEST:
        return []
    k = deciding_check(claim, robustness)
    check = claim.checks[k]
    # Where something diverges the claim fails worst.
    margins = [
        check.margin(trial.outcome.numbers[k]) if trial.outcome.numbers else -math.inf
        for trial in robustness.trials
    ]
    found = []
    for column, name in enumerate(robustness.names):
        places = as_places([trial.values[column] for trial in robustness.trials])
        if len(set(places)) > 1 and len(set(margins)) > 1 and name != "seed":
            result = chatterjeexi(places, ranks(margins))
            found.append(Influence(name, float(result.statistic), float(result.pvalue)))
    return sorted(found, key=lambda one: -one.share)


def as_places(values: Sequence[Any]) -> list[float]:
    """Numbers as they are; anything else by its place among those that were drawn."""
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return [float(value) for value in values]
    return [float(place) for place in ranks([repr(value) for value in values])]


def ranks(values: Sequence[Any]) -> list[int]:
    """The place of each among the different values, in order, from 0 on."""
    place: list[int] = np.unique(values, return_inverse=True)[1].tolist()
    return place
