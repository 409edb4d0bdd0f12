"""Sensitivity of claims: how much of the outcome over samples each choice explains.

The measure is Chatterjee's rank correlation (2021, J. Am. Stat. Assoc. 116:2009) of the outcome,
yes or no, with a choice. It is 0 where the outcome does not depend on the choice, and near 1 where
the choice alone decides, whichever of its values make the claim true. From samples at hand it
estimates the Cramer-von Mises index of first order (Gamboa et al. 2022, SIAM/ASA J. Uncertain.
Quantif. 10:1). What remains below one is other choices, their interplay, and the random seed.

One looks at all choices of all claims of a paper, so that some would stand out by chance. So each
probability is corrected for the number of looks (Benjamini & Yekutieli 2001, Ann. Statist.
29:1165): of all choices below 5 % no more than one in twenty is expected to be there by chance.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from reobserve_papers.claims.inquiry import Robustness
from reobserve_papers.claims.outcomes import deciding, nested
from reobserve_papers.claims.registry import Claim

FEWEST = 16  # samples; with less, chance makes half of the scale
_RAREST = 5  # of either outcome; with less, its probability by chance is wrong


class Influence(NamedTuple):
    """Influence of one choice: the rank correlation, and how probable one as great is by chance."""

    name: str
    share: float
    chance: float


def deciding_check(claim: Claim, robustness: Robustness) -> int:
    """The check that fails in most samples, the first of those that fail as often."""
    drawn = [numbers for numbers in deciding_numbers(claim, robustness) if numbers]
    fails = [
        sum(not check.satisfied_by(numbers[k]) for numbers in drawn)
        for k, check in enumerate(claim.checks)
    ]
    return fails.index(max(fails))


def deciding_numbers(claim: Claim, robustness: Robustness) -> list[tuple[float, ...]]:
    """The numbers that decide the checks, none for a sample that diverged or was refused."""
    return [
        deciding(claim, None if trial.numbers is None else nested(trial.numbers))
        for trial in robustness.trials
    ]


def influences(samples: Iterable[tuple[Claim, Robustness]]) -> list[list[Influence]]:
    """The influence of every choice with a range on each claim, largest first.

    Empty for a claim with too few samples, or that holds or fails in fewer than five. The
    probabilities are corrected for the number of choices of all claims together.
    """
    from scipy.stats import false_discovery_control

    each = [_influences(*pair) for pair in samples]
    chances = [bar.chance for bars in each for bar in bars]
    corrected = iter(false_discovery_control(chances, method="by") if chances else ())
    each = [[bar._replace(chance=float(next(corrected))) for bar in bars] for bars in each]
    return [sorted(bars, key=lambda bar: -bar.share) for bars in each]


def _influences(claim: Claim, robustness: Robustness) -> list[Influence]:
    from scipy.stats import chatterjeexi

    outcomes = [int(outcome == "holds") for outcome in robustness.outcomes(claim)]
    held = sum(outcomes)
    if len(outcomes) < FEWEST or min(held, len(outcomes) - held) < _RAREST:
        return []
    bars = []
    for column, name in enumerate(robustness.names):
        places = as_places([trial.values[column] for trial in robustness.trials])
        if len(set(places)) > 1 and name != "seed":
            # Where values of a choice are alike their order is that of the samples, which is
            # random.
            result = chatterjeexi(places, outcomes)
            bars.append(Influence(name, float(result.statistic), float(result.pvalue)))
    return bars


def as_places(values: Sequence[Any]) -> list[float]:
    """Numbers as they are, and anything else by its place among those that were sampled."""
    if all(isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return [float(value) for value in values]
    return [float(place) for place in ranks([repr(value) for value in values])]


def ranks(values: Sequence[Any]) -> list[int]:
    """The place of each among the different values, in order, from 0 on."""
    place: list[int] = np.unique(values, return_inverse=True)[1].tolist()
    return place
