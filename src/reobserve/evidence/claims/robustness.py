"""How firmly a claim stands: over draws of what the paper leaves open, and one change at a time."""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from reobserve.errors import DivergenceError, InputError
from reobserve.evidence.claims.checks import THEORY, Numbers
from reobserve.evidence.claims.choices import Knob, change, draw
from reobserve.evidence.claims.registry import Claim
from reobserve.ledger.ledger import Ledger
from reobserve.numerics.random_streams import random_stream
from reobserve.pipeline.evaluation import Evaluator
from reobserve.scoring.metrics import Metric, lookup

# Shares of the way from a value to an end of its range at which a flip is looked for, and how often
# the first interval that holds one is halved. Claims on expensive figures look only at the ends
# and narrow only the smallest of the changes.
_STEPS = (1 / 16, 1 / 4, 1.0)
_HALVINGS = 4

# Draws that the code refuses are drawn again, up to this many for each that is wanted.
_ATTEMPTS = 4


@dataclass(frozen=True)
class Flip:
    """The smallest change of one number of the ledger that was found to flip a claim.

    ``key`` is a ledger key (of several that move together in one, as ``a.{b,c}.d``) with the place
    in its value, ``unit`` that of the entry; ``size`` is the part of the number's range (of
    magnitudes where it spans a decade) that it moves, one for a word.
    """

    key: str
    unit: str
    start: Any
    end: Any
    size: float


@dataclass
class Robustness:
    """Of one claim: in how many draws it held, and the smallest change that flips it.

    ``flip`` is None if none was found; ``looked`` is false where nobody looked. Draws in which
    something diverges count as not held; those that the code refuses, because no reader could
    have run them, do not count.
    """

    draws: int = 0
    held: int = 0
    diverged: int = 0
    refused: int = 0
    flip: Flip | None = None
    looked: bool = True

    @property
    def share(self) -> float:
        """Of the draws in which the claim held."""
        return self.held / self.draws if self.draws else float("nan")

    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % confidence interval of the share."""
        from scipy.stats import binomtest

        if not self.draws:
            return 0.0, 1.0
        found = binomtest(self.held, self.draws).proportion_ci(0.95, method="wilson")
        return float(found.low), float(found.high)


class Outcomes:
    """Whether claims hold with other ledgers; what a change does not touch is not run again."""

    def __init__(self, ledger: Ledger, claims: Iterable[Claim]) -> None:
        # Siblings start from what this one has run: all that the claims need.
        self._base = Evaluator(ledger)
        figures = dict.fromkeys(figure for claim in claims for figure in claim.figures)
        self._stated = {figure: lookup(metrics_of(self._base, figure)) for figure in figures}

    def at(self, ledger: Ledger, claims: Iterable[Claim]) -> dict[str, bool | None]:
        """By claim: whether it holds; None where something that it needs diverges.

        Raises
        ------
        InputError
            If the ledger cannot be run, or a claim names a number that does not exist.
        """
        evaluator = self._base.sibling(ledger)
        numbers: dict[str, Any] = {}
        diverged = set()
        outcomes: dict[str, bool | None] = {}
        for claim in claims:
            for figure in claim.figures:
                if figure in numbers or figure in diverged:
                    continue
                try:
                    numbers[figure] = lookup(metrics_of(evaluator, figure))
                except DivergenceError:
                    diverged.add(figure)
            outcomes[claim.name] = (
                None if diverged.intersection(claim.figures) else holds(claim, numbers)
            )
        return outcomes

    def stated(self, claim: Claim) -> bool | None:
        """Whether a claim holds with the ledger as it is; None if it names a number nobody has."""
        try:
            return holds(claim, self._stated)
        except InputError:
            return None


def metrics_of(evaluator: Evaluator, figure: str) -> list[Metric]:
    """The numbers behind a figure, or of the theory."""
    return evaluator.theory() if figure == THEORY else evaluator.figure(figure).metrics


def holds(claim: Claim, numbers: Numbers) -> bool:
    """Whether all checks of a claim hold; see `Check.holds`."""
    return all(check.holds(numbers) for check in claim.checks)


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
        How many for each claim; fewer for those on expensive figures.
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
    asked = [claim for claim in asked if outcomes.stated(claim) is not None]
    found = {claim.name: Robustness(looked=flips) for claim in asked}
    groups = defaultdict(list)
    for claim in asked:
        groups[tuple(claim.keys), claim.draws_divided_by].append(claim)
    for (_, divided_by), members in groups.items():
        _draw_group(ledger, outcomes, -(-draws // divided_by), members, found)
    if flips:
        for name, flip in _smallest_flips(ledger, outcomes, asked).items():
            found[name].flip = flip
    return found


def _draw_group(
    ledger: Ledger,
    outcomes: Outcomes,
    draws: int,
    claims: list[Claim],
    found: dict[str, Robustness],
) -> None:
    """Decide the claims that depend on the same choices over the same draws."""
    choices, keys = claims[0].choices, " ".join(claims[0].keys)
    for attempt in range(_ATTEMPTS * draws):
        if found[claims[0].name].draws == draws:
            break
        stream = random_stream(ledger.seed, "claims", ledger.paper, keys, str(attempt))
        try:
            held = outcomes.at(draw(ledger, choices, stream), claims)
        except InputError:
            for claim in claims:
                found[claim.name].refused += 1
            continue
        for claim in claims:
            one = found[claim.name]
            one.draws += 1
            one.held += held[claim.name] is True
            one.diverged += held[claim.name] is None


@dataclass(frozen=True)
class _Bracket:
    """A change of one knob that flips a claim, and a smaller one that does not."""

    knob: Knob
    toward: float
    below: float
    size: float
    value: Any


def _smallest_flips(
    ledger: Ledger, outcomes: Outcomes, claims: Sequence[Claim]
) -> dict[str, Flip | None]:
    stated = {claim.name: outcomes.stated(claim) for claim in claims}
    brackets: dict[str, list[_Bracket]] = {claim.name: [] for claim in claims}
    knobs = {k.keys + k.path: k for claim in claims for c in claim.choices for k in c.knobs}
    for knob in knobs.values():
        concerned = [c for c in claims if any(knob in choice.knobs for choice in c.choices)]
        for toward in (0.0, 1.0):
            _scan(ledger, outcomes, knob, toward, concerned, stated, brackets)
    units = {key: entry["unit"] for key, entry in ledger.entries()}
    flips: dict[str, Flip | None] = {}
    for claim in claims:
        best: _Bracket | None = None
        ordered = sorted(brackets[claim.name], key=lambda one: (one.size, one.below))
        for bracket in ordered[: None if claim.draws_divided_by == 1 else 1]:
            if best is None or bracket.below < best.size:
                narrowed = _narrow(ledger, outcomes, claim, stated[claim.name], bracket)
                best = narrowed if best is None else min(best, narrowed, key=lambda one: one.size)
        flips[claim.name] = None if best is None else _flip(best, units)
    return flips


def _flip(bracket: _Bracket, units: Mapping[str, str]) -> Flip:
    knob = bracket.knob
    return Flip(knob.name, units[knob.keys[0]], knob.value, bracket.value, bracket.size)


def _scan(
    ledger: Ledger,
    outcomes: Outcomes,
    knob: Knob,
    toward: float,
    claims: list[Claim],
    stated: dict[str, bool | None],
    brackets: dict[str, list[_Bracket]],
) -> None:
    """Move a knob towards an end of its range until claims flip; keep where each flips first."""
    if knob.words:
        # Words have no order: each other one is a change by itself, looked at once.
        moves = [(1.0, word) for word in knob.words if word != knob.value] if toward else []
    else:
        start = knob.place(knob.value)
        moves = [(t * abs(toward - start), knob.at(start + t * (toward - start))) for t in _STEPS]
    below = 0.0
    waiting = list(claims)
    for step, (size, value) in enumerate(moves):
        last = step == len(moves) - 1
        here = [claim for claim in waiting if last or claim.draws_divided_by == 1]
        if value != knob.value and here:
            held = _outcomes_or_none(ledger, outcomes, knob, value, here)
            for claim in here if held else ():
                assert held is not None
                if held[claim.name] != stated[claim.name]:
                    expensive = claim.draws_divided_by > 1
                    lower = 0.0 if expensive or knob.words else below
                    brackets[claim.name].append(_Bracket(knob, toward, lower, size, value))
                    if not knob.words:
                        waiting.remove(claim)
        below = size


def _narrow(
    ledger: Ledger, outcomes: Outcomes, claim: Claim, stated: bool | None, bracket: _Bracket
) -> _Bracket:
    """Halve the interval between the change that flips and the one that does not."""
    knob = bracket.knob
    if knob.words:
        return bracket
    start = knob.place(knob.value)
    sign = 1.0 if bracket.toward > start else -1.0
    for _ in range(_HALVINGS):
        size = (bracket.below + bracket.size) / 2
        value = knob.at(start + sign * size)
        if value in (knob.value, bracket.value):
            break
        held = _outcomes_or_none(ledger, outcomes, knob, value, [claim])
        if held is not None and held[claim.name] != stated:
            bracket = dataclasses.replace(bracket, size=size, value=value)
        else:
            bracket = dataclasses.replace(bracket, below=size)
    return bracket


def _outcomes_or_none(
    ledger: Ledger, outcomes: Outcomes, knob: Knob, value: Any, claims: list[Claim]
) -> dict[str, bool | None] | None:
    """None where the code refuses the value: nobody could have run it."""
    try:
        return outcomes.at(change(ledger, knob, value), claims)
    except InputError:
        return None
