"""How firmly a claim stands: over draws of what the paper leaves open, and one change at a time."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from reobserve.errors import InputError
from reobserve.evidence.claims import sequential
from reobserve.evidence.claims.choices import draw
from reobserve.evidence.claims.flips import Flip, smallest_flips
from reobserve.evidence.claims.outcomes import Outcome, Outcomes
from reobserve.evidence.claims.registry import Claim
from reobserve.ledger.ledger import Ledger
from reobserve.numerics.random_streams import random_stream

# Of the draws: from here on a claim stands whatever else a reader chooses, and as rarely as this
# leaves it is said to fail. One in ten may choose badly. Set before anything was drawn.
FIRM = 0.9

# No claim is decided by fewer draws, if it may have as many: which choice decides can only be told
# from some. It does not weaken the decision, which may be taken at any number of draws.
_LEAST = 20

# Draws that the code refuses are drawn again, up to this many for each that is wanted.
_ATTEMPTS = 4

# So many draws with the same numbers show that what a claim depends on does not reach them.
_ALIKE = 8


@dataclass(frozen=True)
class Trial:
    """One draw: what was chosen, a value for each name of `Robustness.names`, and the outcome."""

    values: tuple[Any, ...]
    outcome: Outcome


@dataclass
class Robustness:
    """Of one claim: the draws that decide it, and the smallest change that flips it.

    ``stated`` is the outcome with the ledger as it is, ``names`` are those of the choices. ``flip``
    is None if none was found; ``looked`` is false where nobody looked. Draws in which something
    diverges count as not held; those that the code refuses, because no reader could have run
    them, do not count.
    """

    stated: Outcome = field(default_factory=lambda: Outcome(True))
    names: tuple[str, ...] = ()
    trials: list[Trial] = field(default_factory=list)
    refused: int = 0
    flip: Flip | None = None
    looked: bool = True

    @property
    def draws(self) -> int:
        """How many there were."""
        return len(self.trials)

    @property
    def held(self) -> int:
        """In how many the claim held."""
        return sum(trial.outcome.held for trial in self.trials)

    @property
    def diverged(self) -> int:
        """In how many something diverged."""
        return sum(not trial.outcome.numbers for trial in self.trials)

    @property
    def share(self) -> float:
        """Of the draws in which the claim held."""
        return self.held / self.draws if self.draws else float("nan")

    @property
    def agreed(self) -> int:
        """In how many the claim fared as it does with the ledger as it is."""
        return self.held if self.stated.held else self.draws - self.held

    @property
    def firm(self) -> bool | None:
        """Whether others would find the same, for nine of ten at least; None if undecided."""
        return sequential.above(FIRM, self.agreed, self.draws)

    def interval(self) -> tuple[float, float]:
        """What the share may be; see `sequential.interval`, which is of the draws that agree."""
        low, high = sequential.interval(self.agreed, self.draws)
        return (low, high) if self.stated.held else (1 - high, 1 - low)

    @property
    def alike(self) -> bool:
        """Whether many draws gave the same numbers, all of them: no choice reaches these."""
        numbers = {repr(trial.outcome.numbers) for trial in self.trials}
        return self.draws >= _ALIKE and len(numbers) == 1 and not self.diverged


def assess(
    ledger: Ledger, claims: Sequence[Claim], draws: int, flips: bool = True
) -> dict[str, Robustness]:
    """The robustness of every claim that depends on something, by name.

    Parameters
    ----------
    ledger
        Draws and moves start from it.
    claims
        Of the same paper; left out are those that are broken or depend on nothing.
    draws
        The most for each claim, if fewer do not decide.
    flips
        Whether to look for the smallest change that flips a claim, which takes longest.

    Raises
    ------
    InputError
        If the ledger as it is cannot be run.
    DivergenceError
        If something diverges with the ledger as it is.
    """
    asked = [claim for claim in claims if claim.checks and claim.choices]
    outcomes = Outcomes(ledger, asked)
    stated = {claim.name: outcomes.stated(claim) for claim in asked}
    found = {
        claim.name: Robustness(outcome, claim.knob_names, looked=flips)
        for claim in asked
        if (outcome := stated[claim.name]) is not None
    }
    asked = [claim for claim in asked if claim.name in found]
    groups = defaultdict(list)
    for claim in asked:
        groups[tuple(claim.keys)].append(claim)
    for members in groups.values():
        _draw_group(ledger, outcomes, draws, members, found)
    if flips:
        for name, flip in smallest_flips(ledger, outcomes, asked).items():
            found[name].flip = flip
    return found


def _draw_group(
    ledger: Ledger,
    outcomes: Outcomes,
    most: int,
    claims: list[Claim],
    found: dict[str, Robustness],
) -> None:
    """Draw for the claims that depend on the same choices until all of them are decided."""
    choices, keys = claims[0].choices, " ".join(claims[0].keys)
    group = [found[claim.name] for claim in claims]
    for attempt in range(_ATTEMPTS * most):
        draws = group[0].draws
        enough = draws >= _LEAST and all(one.firm is not None for one in group)
        if draws == most or enough:
            break
        stream = random_stream(ledger.seed, "claims", ledger.paper, keys, str(attempt))
        drawn, values = draw(ledger, choices, stream)
        try:
            there = outcomes.at(drawn, claims)
        except InputError:
            for one in group:
                one.refused += 1
            continue
        for claim, one in zip(claims, group, strict=True):
            one.trials.append(Trial(values, there[claim.name]))
