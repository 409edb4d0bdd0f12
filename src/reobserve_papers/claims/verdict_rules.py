"""The verdict on a claim, and the title of a replication.

A verdict is a share: of all settings that a paper leaves open, in how many does the claim hold? A
share of nine tenths or more (the convention ``share``) is reproduced, one of a tenth or less is
contradicted, and between the two the claim depends on choices that the paper does not state. The
settings of the parameter file are one of many and have no vote.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from reobserve_papers.claims import sequential
from reobserve_papers.claims.entries import Quantifier

REPRODUCED = "reproduced"
CALIBRATED = "reproduced only by calibration"
DEPENDS = "depends on unstated choices"
CONTRADICTED = "contradicted"
UNDECIDED = "undecided"
NOT_TESTABLE = "not testable"
BROKEN = "broken"
VERDICTS = (REPRODUCED, CALIBRATED, DEPENDS, CONTRADICTED, UNDECIDED, NOT_TESTABLE)

RE, NOT_RE, OPEN = "[Re]", "[¬Re]", "[Re?]"

Row = Mapping[str, str]  # of the table of claims


def then(verdict: str) -> str:
    """The predicate of a claim with a verdict."""
    return f"then {verdict}" if verdict == DEPENDS else f"is then {verdict}"


@dataclass(frozen=True)
class Counted:
    """The settings in which a claim was tried, and in how many it held.

    ``whole`` says that these are all that there are; else they are random samples. In some, which
    are ``refused``, there is no observer. It does not hold there, but they are no counterexamples.
    """

    held: int
    samples: int
    whole: bool = False
    refused: int = 0

    def at_least(self, share: float) -> bool | None:
        """True if it holds in this share of all settings or more, None if that is undecided."""
        if self.whole and self.samples:
            return self.held >= share * self.samples - 1e-9
        return sequential.above(share, self.held, self.samples)

    def at_most(self, share: float) -> bool | None:
        """True if it holds in this share of all settings or less, None if that is undecided."""
        failed = Counted(self.samples - self.held, self.samples, self.whole)
        return failed.at_least(1 - share)

    def interval(self) -> tuple[float, float]:
        """The interval of the share, each end wrong with probability `sequential.ERROR`."""
        if self.whole and self.samples:
            share = self.held / self.samples
            return share, share
        if 2 * self.held >= self.samples:
            return sequential.interval(self.held, self.samples)
        low, high = sequential.interval(self.samples - self.held, self.samples)
        return 1 - high, 1 - low


def possible(
    quantifier: Quantifier, counted: Counted, share: float, fitted: bool = False
) -> tuple[str, ...]:
    """The verdicts that a count allows, of which one alone decides the claim.

    Parameters
    ----------
    quantifier
        One counterexample contradicts a claim of what is `always` so, one setting reproduces
        what is to be `shown`.
    counted
        In how many settings it was tried, and held.
    share
        The share of settings from which on a claim is reproduced.
    fitted
        Whether a setting is known at which it holds, and the claim is one of what `can` be, or of
        numbers that the paper prints: it is not contradicted where such settings are rare.
    """
    low = CALIBRATED if fitted else CONTRADICTED
    if quantifier == "shown":
        shown, never = fitted or counted.held > 0, counted.at_most(1 - share)
        return tuple([REPRODUCED] * (shown or not never) + [CONTRADICTED] * (not shown))
    if quantifier == "always":
        tried = counted.samples - counted.refused
        if counted.held < tried:
            return (CONTRADICTED,)
        enough = Counted(counted.held, tried, counted.whole).at_least(share)
        return (REPRODUCED,) if enough else (REPRODUCED, CONTRADICTED)
    often, seldom = counted.at_least(share), counted.at_most(1 - share)
    if often:
        return (REPRODUCED,)
    if seldom:
        return (low,)
    allowed = [REPRODUCED] if often is None else []
    return (*allowed, DEPENDS, *([low] if seldom is None else []))


def count(rows: Iterable[Row]) -> dict[str, dict[str, int]]:
    """Claims by paper and verdict, from the rows of the table of claims."""
    counts: dict[str, dict[str, int]] = {}
    for row in rows:
        paper = counts.setdefault(row["paper"], dict.fromkeys((*VERDICTS, BROKEN), 0))
        paper[row["verdict"]] += 1
    return counts


@dataclass(frozen=True)
class Judged:
    """The part of a claim that decides a title: its promises, and the verdicts it may have.

    ``held`` are the numbers that these rest on, in words.
    """

    name: str
    place: str
    promised: tuple[str, ...]
    purpose: tuple[str, ...]
    verdicts: tuple[str, ...]
    held: str = ""

    @property
    def verdict(self) -> str:
        """The verdict, in one word."""
        return self.verdicts[0] if len(self.verdicts) == 1 else UNDECIDED


# Which claims are main claims: by each value of the convention `main`.
_MAIN: Mapping[str, Callable[[Judged, tuple[str, ...]], bool]] = {
    "abstract and conclusions": lambda claim, promised: bool(promised),
    "abstract": lambda claim, promised: "abstract" in promised,
    "conclusions": lambda claim, promised: "conclusions" in promised,
    "figures": lambda claim, promised: re.search(r"\bFigs?\b", claim.place) is not None,
    "all claims": lambda claim, promised: True,
}


def main_claims(claims: Iterable[Judged], main: str, purpose: str) -> list[Judged]:
    """The main claims of a paper by two conventions, without those that nothing can test."""
    chosen = []
    for claim in claims:
        promised = claim.promised + (claim.purpose if purpose == "counts" else ())
        if _MAIN[main](claim, promised) and claim.verdict != NOT_TESTABLE:
            chosen.append(claim)
    return chosen


def title_by(verdicts: Sequence[str], majority: float) -> str:
    """The title by the verdicts on the main claims, of which undecided ones count as neither."""
    if CONTRADICTED in verdicts or BROKEN in verdicts:
        return NOT_RE
    return RE if verdicts.count(REPRODUCED) > majority * len(verdicts) else OPEN


def title_of(claims: Sequence[Judged], majority: float) -> str:
    """The title by main claims."""
    return title_by([claim.verdict for claim in claims], majority)


def open_verdicts(claims: Sequence[Judged], majority: float) -> Iterator[tuple[str, str, str]]:
    """Yield what an open interval would change: claim, verdict that it allows, title."""
    title = title_of(claims, majority)
    for claim in claims:
        if len(claim.verdicts) == 1:
            continue
        for word in claim.verdicts:
            others = [word if judged is claim else judged.verdict for judged in claims]
            if (other := title_by(others, majority)) != title:
                yield claim.name, word, other
