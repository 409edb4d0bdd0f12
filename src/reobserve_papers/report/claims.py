"""Claims with their verdicts, as the build computed them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from reobserve_papers.claims.robustness import Robustness as Drawn
from reobserve_papers.claims.table import NOT_LOOKED_FOR
from reobserve_papers.report.reading import Gap

_DRAWN = ("samples", "held", "share", "low", "high")


@dataclass(frozen=True)
class ReportedRobustness:
    """Firmness of a verdict: over samples of the unstated choices, and by single moves.

    ``share`` of the samples held the claim, with its 95 % interval ``low`` to ``high``.
    """

    samples: int
    held: int
    share: float
    low: float
    high: float
    reversal_key: str
    reversal: str
    looked: bool
    diverged: int
    refused: int
    cached: int


@dataclass(frozen=True)
class ReportedClaim:
    """Claim of a paper, and what was found."""

    name: str
    promised: str
    quantifier: str
    place: str
    statement: str
    verdict: str
    measured: tuple[str, ...]
    why: str
    threshold: str
    margin: str
    figures: tuple[str, ...]
    depends_on: tuple[str, ...]
    robustness: ReportedRobustness | None
    problem: Gap | None

    @property
    def is_main(self) -> bool:
        """True if the title of the replication depends on it."""
        return bool(self.promised)


def claim_of_row(
    row: Mapping[str, str], samples: Drawn, problem: Gap | None = None
) -> ReportedClaim:
    """Return a claim, from its row of the table with all cells as text, and from its samples."""
    texts = {
        key: row[key]
        for key in (
            "promised",
            "quantifier",
            "place",
            "statement",
            "verdict",
            "why",
            "threshold",
            "margin",
        )
    }
    return ReportedClaim(
        name=row["claim"],
        # Check by check: each begins with the figure or the theory it names.
        measured=tuple(filter(None, re.split(r"; (?=(?:fig\w+|theory) )", row["measured"]))),
        figures=tuple(row["figures"].split()),
        depends_on=tuple(row["depends_on"].split()),
        robustness=_robustness(row, samples),
        problem=problem,
        **texts,
    )


def _robustness(row: Mapping[str, str], samples: Drawn) -> ReportedRobustness | None:
    if not all(row[key] for key in _DRAWN) or int(row["samples"]) == 0:
        return None
    looked = row["reversal"] != NOT_LOOKED_FOR
    key, _, moved = row["reversal"].partition(" ") if looked else ("", "", "")
    return ReportedRobustness(
        samples=int(row["samples"]),
        held=int(row["held"]),
        share=float(row["share"]),
        low=float(row["low"]),
        high=float(row["high"]),
        reversal_key=key,
        reversal=moved,
        looked=looked,
        diverged=samples.diverged,
        refused=len(samples.refused),
        cached=samples.cached,
    )
