"""The smallest change of one choice that turns a claim over."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from reobserve.core.errors import InputError, shown
from reobserve_papers.claims.choices import Knob, change
from reobserve_papers.claims.outcomes import Outcomes
from reobserve_papers.claims.registry import Claim
from reobserve_papers.parameters.parameters import Parameters

# Shares of the way from a value to an end of its range at which a reversal is looked for, and how
# often the first interval that holds one is halved. Expensive claims are looked at the ends only,
# and only the smallest of the changes is narrowed.
_STEPS = (1 / 16, 1 / 4, 1.0)
_HALVINGS = 4


@dataclass(frozen=True)
class Reversal:
    """The smallest change of one number of the parameter file that was found to reverse a claim.

    ``key`` is a parameter file key (of several that move together in one, as ``a.{b,c}.d``) with
    the place in its value, ``unit`` that of the entry; ``size`` is the part of the number's range
    (of magnitudes where it spans a decade) that it moves, one for a word.
    """

    key: str
    unit: str
    start: Any
    end: Any
    size: float

    def __post_init__(self) -> None:
        """Refuse a change that is none: `InputError`."""
        if is_number(self.start) != is_number(self.end) or self.start == self.end:
            problem = f"{shown(self.end)} must be another value of the kind of {shown(self.start)}"
            raise InputError("end", problem)


def is_number(value: Any) -> bool:
    """True if it has a place in an interval, and is not yes or no."""
    return isinstance(value, int | float) and not isinstance(value, bool)


@dataclass(frozen=True)
class _Bracket:
    """A change of one knob that reverses a claim, and a smaller one that does not."""

    knob: Knob
    toward: float
    below: float
    size: float
    value: Any


def smallest_reversals(
    parameters: Parameters, outcomes: Outcomes, claims: Sequence[Claim]
) -> dict[str, Reversal | None]:
    """The smallest change of one choice that was found to turn a claim over, by claim."""
    stated = {claim.name: _holds_as_stated(outcomes, claim) for claim in claims}
    brackets: dict[str, list[_Bracket]] = {claim.name: [] for claim in claims}
    knobs = {k.keys + k.path: k for claim in claims for c in claim.choices for k in c.knobs}
    for knob in knobs.values():
        concerned = [c for c in claims if any(knob in choice.knobs for choice in c.choices)]
        for toward in (0.0, 1.0):
            _scan(parameters, outcomes, knob, toward, concerned, stated, brackets)
    units = {key: entry["unit"] for key, entry in parameters.entries()}
    reversals: dict[str, Reversal | None] = {}
    for claim in claims:
        best: _Bracket | None = None
        ordered = sorted(brackets[claim.name], key=lambda one: (one.size, one.below))
        for bracket in ordered[: 1 if claim.expensive else None]:
            if best is None or bracket.below < best.size:
                narrowed = _narrow(parameters, outcomes, claim, stated[claim.name], bracket)
                best = narrowed if best is None else min(best, narrowed, key=lambda one: one.size)
        reversals[claim.name] = None if best is None else _reversal(best, units)
    return reversals


def _reversal(bracket: _Bracket, units: Mapping[str, str]) -> Reversal:
    knob = bracket.knob
    return Reversal(knob.name, units[knob.keys[0]], knob.value, bracket.value, bracket.size)


def _scan(
    parameters: Parameters,
    outcomes: Outcomes,
    knob: Knob,
    toward: float,
    claims: list[Claim],
    stated: dict[str, bool],
    brackets: dict[str, list[_Bracket]],
) -> None:
    """Move a knob towards an end of its range, and keep where each claim is reversed first."""
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
        here = [claim for claim in waiting if last or not claim.expensive]
        if value != knob.value and here:
            held = _held(parameters, outcomes, knob, value, here)
            for claim in here:
                if held[claim.name] != stated[claim.name]:
                    lower = 0.0 if claim.expensive or knob.words else below
                    brackets[claim.name].append(_Bracket(knob, toward, lower, size, value))
                    if not knob.words:
                        waiting.remove(claim)
        below = size


def _narrow(
    parameters: Parameters, outcomes: Outcomes, claim: Claim, stated: bool, bracket: _Bracket
) -> _Bracket:
    """Halve the interval between the change that reverses the verdict and the one that does not."""
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
        held = _held(parameters, outcomes, knob, value, [claim])
        if held[claim.name] != stated:
            bracket = dataclasses.replace(bracket, size=size, value=value)
        else:
            bracket = dataclasses.replace(bracket, below=size)
    return bracket


def _held(
    parameters: Parameters, outcomes: Outcomes, knob: Knob, value: Any, claims: list[Claim]
) -> dict[str, bool]:
    """The claims that hold, or none where the code refuses the value."""
    try:
        found = outcomes.apart().at(change(parameters, knob, value), claims)
    except InputError:
        return dict.fromkeys((claim.name for claim in claims), False)
    return {name: one.held for name, one in found.items()}


def _holds_as_stated(outcomes: Outcomes, claim: Claim) -> bool:
    stated = outcomes.stated(claim)
    return stated is not None and stated.held
