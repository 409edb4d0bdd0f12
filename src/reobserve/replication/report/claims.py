"""Claims with their verdicts, as the build computed them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from reobserve.replication.claims.robustness import Robustness as Drawn
from reobserve.replication.claims.table import NOT_LOOKED_FOR
from reobserve.replication.report.reading import Gap

_DRAWN = ("draws", "held", "share", "low", "high")


@dataclass(frozen=True)
class Robustness:
    """How firmly a verdict stands: over draws of the unstated choices, and by single moves.

    ``share`` of the draws held the claim, with its 95 % interval ``low`` to ``high``.
    """

    draws: int
    held: int
    share: float
    low: float
    high: float
    flip_key: str
    flip: str
    looked: bool
    diverged: int
    refused: int
    kept: int


@dataclass(frozen=True)
class Claim:
    """What a paper says, and what was found."""

    name: str
    promised: str
    quantifier: str
    place: str
    says: str
    verdict: str
    measured: tuple[str, ...]
    why: str
    threshold: str
    room: str
    figures: tuple[str, ...]
    depends_on: tuple[str, ...]
    robustness: Robustness | None
    problem: Gap | None

    @property
    def headline(self) -> bool:
        """Whether the title of the replication depends on it."""
        return bool(self.promised)


def claim_of_row(row: Mapping[str, str], draws: Drawn, problem: Gap | None = None) -> Claim:
    """Return a claim, from its row of the table with all cells as text, and from its draws."""
    texts = {
        key: row[key]
        for key in (
            "promised",
            "quantifier",
            "place",
            "says",
            "verdict",
            "why",
            "threshold",
            "room",
        )
    }
    return Claim(
        name=row["claim"],
        # Check by check: each begins with the figure or the theory it names.
        measured=tuple(filter(None, re.split(r"; (?=(?:fig\w+|theory) )", row["measured"]))),
        figures=tuple(row["figures"].split()),
        depends_on=tuple(row["depends_on"].split()),
        robustness=_robustness(row, draws),
        problem=problem,
        **texts,
    )


def _robustness(row: Mapping[str, str], draws: Drawn) -> Robustness | None:
    if not all(row[key] for key in _DRAWN) or int(row["draws"]) == 0:
        return None
    looked = row["flip"] != NOT_LOOKED_FOR
    key, _, moved = row["flip"].partition(" ") if looked else ("", "", "")
    return Robustness(
        draws=int(row["draws"]),
        held=int(row["held"]),
        share=float(row["share"]),
        low=float(row["low"]),
        high=float(row["high"]),
        flip_key=key,
        flip=moved,
        looked=looked,
        diverged=draws.diverged,
        refused=len(draws.refused),
        kept=draws.kept,
    )
