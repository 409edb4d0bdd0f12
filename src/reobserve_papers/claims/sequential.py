"""Sequential confidence bounds on a share of yes and no.

After every sample one may look: the interval covers the share with its probability at all numbers
of samples at once, so that it does not matter that the samples go on until it decides. It holds the
shares that no gambler who bets against them has ruined: with probability q drawn from a Beta
distribution, the likelihood ratio of the samples against a share p is a martingale if p is the
share, and by Ville's inequality it ever reaches 1 / a with a probability of at most a (Robbins
1970, Ann. Math. Statist. 41:1397; Ramdas et al. 2023, Stat. Sci. 38:576).

Samples have the words of a choice in equal numbers (`choices.Knob.block`). With words of one choice
the ratio has an expectation of at most one at any number of samples (Maclaurin's inequality). With
those of several, the share has a variance that is larger by one eleventh at most than that of
independent samples. The tests compute the probability of an error exactly in cases of both.
"""

from __future__ import annotations

import math

# The probability that a share below the line is ever said to be above it, and the other way round.
ERROR = 0.05

# The gamblers: one bets on shares near one, the other on any. With the first, samples that all
# agree decide soonest that their share is above nine tenths (after 36 of them).
_NEAR_ONE = (2.0, 0.25)
_ANY = (1.0, 1.0)


def interval(agreed: int, samples: int) -> tuple[float, float]:
    """The interval of the share that agrees, each end ever wrong with probability `ERROR`."""
    if not samples:
        return 0.0, 1.0
    share = agreed / samples
    low = _end(_NEAR_ONE, agreed, samples, 0.0, share)
    high = _end(_ANY, agreed, samples, 1.0, share)
    return low, high


def above(line: float, agreed: int, samples: int) -> bool | None:
    """True if the share is at ``line`` or above it, or None if that is not decided."""
    if agreed > line * samples and _evidence(_NEAR_ONE, agreed, samples, line) >= -math.log(ERROR):
        return True
    if agreed < line * samples and _evidence(_ANY, agreed, samples, line) >= -math.log(ERROR):
        return False
    return None


def _evidence(prior: tuple[float, float], agreed: int, samples: int, share: float) -> float:
    """The logarithm of what the gambler has made of one, had the samples this share."""
    a, b = prior
    other = samples - agreed
    if (agreed and share <= 0) or (other and share >= 1):
        return math.inf
    mixed = _log_beta(a + agreed, b + other) - _log_beta(a, b)
    fair = (agreed and agreed * math.log(share)) + (other and other * math.log1p(-share))
    return mixed - fair


def _end(
    prior: tuple[float, float], agreed: int, samples: int, outside: float, inside: float
) -> float:
    """The place where the evidence against a share falls below the bound, by bisection."""
    bound = -math.log(ERROR)
    if _evidence(prior, agreed, samples, outside) < bound:
        return outside
    for _ in range(60):
        middle = (outside + inside) / 2
        if _evidence(prior, agreed, samples, middle) >= bound:
            outside = middle
        else:
            inside = middle
    return outside


def _log_beta(a: float, b: float) -> float:
    return math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b)
